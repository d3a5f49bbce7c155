// SPDX-License-Identifier: Apache-2.0
// lenticule bench exact --rates measures the rates of visibility and of whole frames.

#include <algorithm>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_timing.h"
#include "apps/lenticule-bench/render/bench_exact.h"
#include "base/print.h"

namespace lenticule::bench {
namespace {

nlohmann::json row(const char* name, uint64_t rays, uint64_t subpixels, double seconds,
                   double visibility, double peak_mib) {
  return {{"name", name},
          {"seconds", seconds},
          {"mray_s", mega_per_second(rays, seconds)},
          {"ns_per_subpixel", nanoseconds_each(subpixels, seconds)},
          {"of_visibility", visibility > 0.0 ? seconds / visibility : 0.0},
          {"peak_resident_mib", peak_mib}};
}

nlohmann::json rows(uint64_t subpixels, const std::vector<CaseTimes>& times) {
  const CaseTimes& whole = times.front();
  const double visibility = median(whole.visibility);
  nlohmann::json list = nlohmann::json::array();
  list.push_back(row("bare Embree", subpixels, subpixels, median(whole.bare), visibility,
                     whole.visibility_peak_mib));
  list.push_back(
      row("visibility", subpixels, subpixels, visibility, visibility, whole.visibility_peak_mib));
  for (size_t i = 0; i < times.size(); ++i)
    list.push_back(row(exact_variants()[i].name, all_rays(times[i].statistics), subpixels,
                       median(times[i].frame), visibility, times[i].frame_peak_mib));
  return list;
}

/// Returns the shares of the workers' time by task; the last variant measures them.
nlohmann::json shares(const render::RenderStatistics& statistics) {
  const auto of = [&](render::Work work) { return statistics.work.at(static_cast<size_t>(work)); };
  return {{"make_rays", of(render::Work::MakeRays)},
          {"embree_primary", of(render::Work::TracePrimary)},
          {"shade", of(render::Work::Shade)},
          {"embree_shadow", of(render::Work::TraceShadows)},
          {"embree_secondary", of(render::Work::TraceSecondary)},
          {"write", of(render::Work::Write)}};
}

}  // namespace

const std::vector<ExactVariant>& exact_variants() {
  static const std::vector<ExactVariant> table = {
      {"whole frame", [](render::RenderOptions&) {}},
      {"no proofs, all rays traced",
       [](render::RenderOptions& options) { options.use_shaft_culling = false; }},
      {"weak rays traced, too",
       [](render::RenderOptions& options) { options.skip_weak_rays = false; }},
      {"background traced, too",
       [](render::RenderOptions& options) { options.skip_background = false; }},
      {"shading with AVX2 at most",
       [](render::RenderOptions& options) { options.isa = std::min(options.isa, Isa::Avx2); }},
      {"shading with SSE2", [](render::RenderOptions& options) { options.isa = Isa::Baseline; }},
      {"with shares of time", [](render::RenderOptions& options) { options.measure_work = true; }},
  };
  return table;
}

nlohmann::json measure_rates(const ExactFlags& flags, const std::string& scene) {
  BenchScene bench(exact_setup(flags, scene));
  std::vector<TimedCase> cases;
  for (const ExactVariant& variant : exact_variants()) {
    TimedCase timed{.scene = &bench, .options = bench.options(flags.depth)};
    timed.with_visibility = cases.empty();
    variant.change(timed.options);
    cases.push_back(std::move(timed));
  }
  const std::vector<CaseTimes> times = time_by_turns(cases, flags.runs);
  const render::RenderStatistics& whole = times.front().statistics;
  return {{"scene", scene},
          {"primitives", bench.primitives()},
          {"lights", bench.description().lights.size()},
          {"lights_dropped", bench.dropped_lights()},
          {"subpixels", bench.subpixels()},
          {"primary_rays", whole.primary_rays},
          {"shadow_rays", whole.shadow_rays},
          {"secondary_rays", whole.secondary_rays},
          {"shadow_rays_culled", whole.shadow_rays_culled},
          {"shadow_rays_blocked", whole.shadow_rays_blocked},
          {"secondary_rays_culled", whole.secondary_rays_culled},
          {"shares", shares(times.back().statistics)},
          {"rows", rows(bench.subpixels(), times)}};
}

void print_rates(const nlohmann::json& r) {
  const auto millions = [&r](const char* key) { return r[key].get<double>() / 1e6; };
  print_out("{}: {} primitives, {} lights", r["scene"].get<std::string>(),
            r["primitives"].get<uint64_t>(), r["lights"].get<int>());
  if (const int dropped = r["lights_dropped"].get<int>(); dropped > 0)
    print_out(" ({} more dropped)", dropped);
  print_out("; {:.3g} M primary, {:.3g} M shadow, {:.3g} M mirrored rays\n",
            millions("primary_rays"), millions("shadow_rays"), millions("secondary_rays"));
  print_out(
      "  culled: {:.3g} M shadow, {:.3g} M mirrored rays that hit nothing, {:.3g} M shadow rays "
      "that are blocked\n",
      millions("shadow_rays_culled"), millions("secondary_rays_culled"),
      millions("shadow_rays_blocked"));
  const auto share = [&r](const char* key) { return 100.0 * r["shares"][key].get<double>(); };
  print_out(
      "  of the time: rays {:.0f} %, Embree {:.0f} % primary, {:.0f} % shadow, {:.0f} % "
      "mirrored, shading {:.0f} %, writing {:.0f} %\n",
      share("make_rays"), share("embree_primary"), share("embree_shadow"),
      share("embree_secondary"), share("shade"), share("write"));
  print_out("  {:<28} {:>8} {:>12} {:>14} {:>9}\n", "", "Mray/s", "ns/subpixel", "of visibility",
            "peak MiB");
  for (const auto& row : r["rows"])
    print_out("  {:<28} {:>8.1f} {:>12.2f} {:>14.2f} {:>9.0f}\n", row["name"].get<std::string>(),
              row["mray_s"].get<double>(), row["ns_per_subpixel"].get<double>(),
              row["of_visibility"].get<double>(), row["peak_resident_mib"].get<double>());
}

}  // namespace lenticule::bench
