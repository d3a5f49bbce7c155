// SPDX-License-Identifier: Apache-2.0
// lenticule bench exact measures method full against what limits it:
//
//   --rates    bare Embree, visibility and whole frames
//   --upright  a rig with upright lenses of whole pixels
//   --growth   time and memory against the number of primitives
//   --peers    Tachyon on pictures of as many rays
//
// Each part measures into JSON and prints its text from that.
#include "apps/lenticule-bench/render/bench_exact.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <thread>

#include "apps/lenticule-bench/harness/bench_scene.h"
#include "apps/lenticule-bench/harness/svg_plot.h"
#include "base/error.h"
#include "base/file.h"
#include "base/print.h"
#include "lab/fixtures.h"
#include "lab/judges/peers.h"
#include "lab/stability/probes.h"
#include "player/process/child_process.h"
#include "player/process/interrupt.h"

namespace lenticule::bench {

namespace {

BenchSetup exact_setup(const ExactFlags& flags, const std::string& scene) {
  return {.scene = scene,
          .rig = flags.rig_instead ? *flags.rig_instead : lab::bench_rig(flags.rig),
          .lights = flags.lights,
          .threads = flags.threads};
}

// Times the cases to compare in interleaved runs, so that other load on the machine affects all
// cases equally.

struct TimedCase {
  BenchScene* scene = nullptr;
  render::RenderOptions options;
  bool with_visibility = true;  ///< also times bare Embree and visibility
};

/// One number per run, in seconds of wall time.
struct CaseTimes {
  std::vector<double> bare;
  std::vector<double> visibility;
  std::vector<double> frame;
  render::RenderStatistics statistics;  ///< statistics of the last frame
  /// Peak resident memory of the process during these runs, in MiB.
  double visibility_peak_mib = 0.0;
  double frame_peak_mib = 0.0;
};

void time_visibility(const TimedCase& timed, CaseTimes& times) {
  const BenchScene& scene = *timed.scene;
  reset_peak_resident();
  const lab::VisibilityTiming timing =
      lab::time_visibility(scene.scene(), scene.model(), timed.options.threads);
  times.visibility_peak_mib = std::max(times.visibility_peak_mib, peak_resident_mib());
  times.bare.push_back(timing.bare_seconds);
  times.visibility.push_back(timing.pass_seconds);
}

void time_frame(const TimedCase& timed, render::Method& method, CaseTimes& times) {
  reset_peak_resident();
  times.statistics = timed.scene->render(method);
  times.frame_peak_mib = std::max(times.frame_peak_mib, peak_resident_mib());
  times.frame.push_back(times.statistics.seconds);
}

/// Runs `runs` rounds of one run of each case. Every second round has the reverse order, because
/// later cases find warmer caches and a warmer processor. Ends early when interrupted.
std::vector<CaseTimes> time_by_turns(const std::vector<TimedCase>& cases, int runs) {
  std::vector<std::unique_ptr<render::Method>> methods;
  methods.reserve(cases.size());
  for (const TimedCase& timed : cases) methods.push_back(timed.scene->method(timed.options));
  std::vector<CaseTimes> times(cases.size());
  for (int run = 0; run < runs; ++run) {
    for (size_t i = 0; i < cases.size(); ++i) {
      if (player::interrupted()) return times;
      const size_t turn = run % 2 == 0 ? i : cases.size() - 1 - i;
      if (cases[turn].with_visibility) time_visibility(cases[turn], times[turn]);
      time_frame(cases[turn], *methods[turn], times[turn]);
    }
  }
  return times;
}

/// A variant of the whole frame: one step turned off or done differently.
struct ExactVariant {
  const char* name;
  void (*change)(render::RenderOptions& options);
};

/// Returns the variants; the first is the whole frame as `render` makes it.
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

/// Returns the rig with upright lenses of a whole number of subpixels (8 for the kiosk), with the
/// same panel and cone of views.
optics::Rig upright_rig(const optics::Rig& slanted) {
  optics::Rig rig = slanted;
  rig.name += ", upright";
  rig.sheet.slant = 0.0;
  const double pitch = std::ceil(slanted.sheet.pitch.value);
  // The cone of views is pitch divided by gap.
  rig.sheet.gap = Millimetres(slanted.sheet.gap.value * pitch / slanted.sheet.pitch.value);
  rig.sheet.pitch = Subpixels(pitch);
  return rig;
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
  constexpr Column kColumns[] = {{"", "name"},
                                 {"Mray/s", "mray_s", "{:.1f}"},
                                 {"ns/subpixel", "ns_per_subpixel", "{:.2f}"},
                                 {"of visibility", "of_visibility", "{:.2f}"},
                                 {"peak MiB", "peak_resident_mib"}};
  print_table(r["rows"], kColumns, "  ");
}

// lenticule bench exact --upright measures the additional cost of slanted lenses of fractional
// pitch over upright ones.

constexpr double kTarget = 1.35;

nlohmann::json measure_upright(const ExactFlags& flags, const std::string& scene) {
  BenchSetup setup = exact_setup(flags, scene);
  BenchScene slanted(setup);
  setup.rig = upright_rig(setup.rig);
  BenchScene upright(setup);
  const std::vector<CaseTimes> times =
      time_by_turns({{.scene = &slanted, .options = slanted.options(flags.depth)},
                     {.scene = &upright, .options = upright.options(flags.depth)}},
                    flags.runs);
  const auto ns = [&](const std::vector<double>& seconds) {
    return nanoseconds_each(slanted.subpixels(), median(seconds));
  };
  const double ratio = median(times[0].frame) / median(times[1].frame);
  return {{"scene", scene},
          {"upright_pitch_subpx", setup.rig.sheet.pitch.value},
          {"slanted_visibility_ns", ns(times[0].visibility)},
          {"upright_visibility_ns", ns(times[1].visibility)},
          {"slanted_frame_ns", ns(times[0].frame)},
          {"upright_frame_ns", ns(times[1].frame)},
          {"slanted_over_upright", ratio},
          {"target", kTarget},
          {"within_target", ratio <= kTarget}};
}

void print_upright(const nlohmann::json& r) {
  const auto number = [&r](const char* key) { return r[key].get<double>(); };
  print_out("{}: slanted against upright with {:.0f} subpixels per lens\n",
            r["scene"].get<std::string>(), number("upright_pitch_subpx"));
  print_out("  visibility     {:8.2f} {:8.2f} ns/subpixel\n", number("slanted_visibility_ns"),
            number("upright_visibility_ns"));
  print_out("  whole frame    {:8.2f} {:8.2f} ns/subpixel, ratio {:.2f} (at most {:.2f}: {})\n",
            number("slanted_frame_ns"), number("upright_frame_ns"), number("slanted_over_upright"),
            number("target"), r["within_target"].get<bool>() ? "met" : "missed");
}

// lenticule bench exact --scaling and --growth measure how the cost grows with threads, subpixels,
// triangles, lights and the pitch of the lenses.

/// A series of setups; the growing quantity is read from the resulting scene.
struct Growth {
  const char* name;
  const char* x_label;
  AxisScale x_scale;
  double (*x_of)(const BenchScene& scene);
  std::vector<BenchSetup> steps;
};

void write_plot(const ExactFlags& flags, const std::string& name, const Plot& plot) {
  if (!flags.plots.empty())
    write_svg(plot, (std::filesystem::path(flags.plots) / (name + ".svg")).string());
}

nlohmann::json row_of(double x, uint64_t subpixels, const CaseTimes& times) {
  return {{"x", x},
          {"subpixels", subpixels},
          {"visibility_ns", nanoseconds_each(subpixels, median(times.visibility))},
          {"frame_ns", nanoseconds_each(subpixels, median(times.frame))},
          {"frame_seconds", median(times.frame)},
          {"rays_per_subpixel", static_cast<double>(all_rays(times.statistics)) /
                                    static_cast<double>(std::max<uint64_t>(1, subpixels))}};
}

PlotSeries series_of(const nlohmann::json& rows, const char* key, std::string label) {
  PlotSeries series{.label = std::move(label), .points = {}};
  for (const auto& row : rows)
    series.points.push_back({row["x"].get<double>(), row[key].get<double>()});
  return series;
}

// ---- threads

std::vector<int> thread_counts() {
  const int all = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  std::vector<int> counts;
  for (int count = 1; count < all; count = all <= 8 ? count + 1 : 2 * count)
    counts.push_back(count);
  counts.push_back(all);
  return counts;
}

nlohmann::json scale_scene(const ExactFlags& flags, const std::string& name) {
  BenchScene bench(exact_setup(flags, name));
  const std::vector<int> counts = thread_counts();
  std::vector<TimedCase> cases;
  for (const int count : counts) {
    cases.push_back({.scene = &bench, .options = bench.options(flags.depth)});
    cases.back().options.threads = count;
  }
  const std::vector<CaseTimes> times = time_by_turns(cases, flags.runs);
  nlohmann::json rows = nlohmann::json::array();
  for (size_t i = 0; i < cases.size(); ++i) {
    rows.push_back(row_of(counts[i], bench.subpixels(), times[i]));
    const double seconds = rows.back()["frame_seconds"].get<double>();
    rows.back()["speed_up"] =
        seconds > 0.0 ? rows.front()["frame_seconds"].get<double>() / seconds : 0.0;
  }
  return {{"name", "threads"}, {"scene", name}, {"x_label", "threads"}, {"rows", std::move(rows)}};
}

// ---- growth

/// Returns the growths of subpixels, triangles, lights and the lens pitch. The cone of views is the
/// same for every pitch: the gap grows with it.
std::vector<Growth> all_growths(const BenchSetup& base) {
  std::vector<Growth> all = {
      {"subpixels",
       "subpixels of the panel",
       AxisScale::Log,
       [](const BenchScene& s) { return static_cast<double>(s.subpixels()); },
       {}},
      {"triangles",
       "triangles of the teapot and its board",
       AxisScale::Log,
       [](const BenchScene& s) { return static_cast<double>(s.primitives()); },
       {}},
      {"lights",
       "lights of the tree",
       AxisScale::Linear,
       [](const BenchScene& s) { return static_cast<double>(s.description().lights.size()); },
       {}},
      {"pitch",
       "subpixels per lens",
       AxisScale::Log,
       [](const BenchScene& s) { return s.setup().rig.sheet.pitch.value; },
       {}}};
  const auto step = [&](size_t growth) -> BenchSetup& {
    return all[growth].steps.emplace_back(base);
  };
  for (const int part : {8, 4, 2, 1}) {
    optics::Panel& panel = step(0).rig.panel;
    panel.width_px = std::max(1, panel.width_px / part);
    panel.height_px = std::max(1, panel.height_px / part);
  }
  for (const int size : {4, 6, 10, 16, 25, 40})
    step(1).scene = fmt::format("builtin:teapot:{}", size);
  for (int lights = 1; lights <= 7; ++lights) {
    BenchSetup& tree = step(2);
    tree.scene = "builtin:tree";
    tree.lights = lights;
  }
  for (const double factor : {0.5, 1.0, 2.0, 4.0, 8.0}) {
    optics::LensSheet& sheet = step(3).rig.sheet;
    sheet.pitch = sheet.pitch * factor;
    sheet.gap = sheet.gap * factor;
  }
  return all;
}

nlohmann::json measure(const ExactFlags& flags, const Growth& growth) {
  std::vector<std::unique_ptr<BenchScene>> scenes;
  std::vector<TimedCase> cases;
  for (const BenchSetup& step : growth.steps) {
    scenes.push_back(std::make_unique<BenchScene>(step));
    cases.push_back({.scene = scenes.back().get(), .options = scenes.back()->options(flags.depth)});
  }
  const std::vector<CaseTimes> times = time_by_turns(cases, flags.runs);
  nlohmann::json rows = nlohmann::json::array();
  for (size_t i = 0; i < cases.size(); ++i)
    rows.push_back(row_of(growth.x_of(*scenes[i]), scenes[i]->subpixels(), times[i]));
  return {{"name", growth.name},
          {"scene", growth.steps.back().scene},
          {"x_label", growth.x_label},
          {"rows", std::move(rows)}};
}

void plot_growth(const ExactFlags& flags, const Growth& growth, const nlohmann::json& measured) {
  const auto& rows = measured["rows"];
  Plot plot;
  plot.title = fmt::format("Cost per subpixel by {}", growth.name);
  plot.x = {.label = growth.x_label, .scale = growth.x_scale};
  // Proportional growth along a linear x axis is visible only with a linear y axis.
  plot.y = {.label = "ns per subpixel", .scale = growth.x_scale};
  plot.series = {series_of(rows, "frame_ns", "whole frame"),
                 series_of(rows, "visibility_ns", "visibility")};
  write_plot(flags, fmt::format("growth-{}", growth.name), plot);
}

nlohmann::json measure_scaling(const ExactFlags& flags) {
  nlohmann::json all = nlohmann::json::array();
  Plot plot;
  plot.title = "Speed-up of the whole frame";
  plot.x.label = "threads";
  plot.y.label = "times as fast as one thread";
  for (const std::string& scene : flags.scenes) {
    all.push_back(scale_scene(flags, bench_scene_name(scene)));
    if (player::interrupted()) return all;
    plot.series.push_back(series_of(all.back()["rows"], "speed_up", scene));
  }
  write_plot(flags, "scaling", plot);
  return all;
}

nlohmann::json measure_growth(const ExactFlags& flags) {
  nlohmann::json all = nlohmann::json::array();
  for (const Growth& growth : all_growths(exact_setup(flags, "builtin:teapot"))) {
    all.push_back(measure(flags, growth));
    if (player::interrupted()) return all;
    plot_growth(flags, growth, all.back());
  }
  return all;
}

void print_growth(const nlohmann::json& growth) {
  print_out("{}: {}\n", growth["name"].get<std::string>(), growth["scene"].get<std::string>());
  const auto x_label = growth["x_label"].get<std::string>();
  const Column columns[] = {
      {x_label.c_str(), "x", "{:.10g}"},       {"visibility ns", "visibility_ns", "{:.2f}"},
      {"frame ns", "frame_ns", "{:.2f}"},      {"frame s", "frame_seconds", "{:.3f}"},
      {"rays", "rays_per_subpixel", "{:.2f}"}, {"speed-up", "speed_up", "{:.2f} x"}};
  print_table(growth["rows"], columns, "  ");
}

// lenticule bench exact --peers runs Tachyon on the same scene, interleaved with this renderer.

/// Returns "tree" for "builtin:tree" and "builtin:tree:9".
std::string short_name(const std::string& scene) {
  const size_t begin = scene.find(':') + 1;
  return scene.substr(begin, scene.find(':', begin) - begin);
}

lab::PeerJob job_of(const ExactFlags& flags, const BenchScene& bench) {
  const optics::Panel& panel = bench.setup().rig.panel;
  const double aspect =
      panel.width_px * panel.pixel_width.value / (panel.height_px * panel.pixel_height.value);
  const double rays =
      flags.peer_mrays > 0.0 ? flags.peer_mrays * 1e6 : static_cast<double>(bench.subpixels());
  lab::PeerJob job = lab::peer_picture(rays, aspect);
  job.max_depth = flags.depth;
  job.threads =
      flags.threads > 0 ? flags.threads : static_cast<int>(std::thread::hardware_concurrency());
  return job;
}

/// Tachyon renders one scene with it, until it fails.
class Tachyon {
 public:
  Tachyon(const render::SceneDescription& scene, int limit_s) : limit_s_(limit_s) {
    const auto program = player::find_program("tachyon");
    if (!program) {
      failure_ = "not installed (scripts/packages bench)";
      return;
    }
    program_ = *program;
    write_text_file(scene_file_, lab::write_plain_nff(scene));
  }

  void keep_picture(const lab::PeerJob& job, const std::string& file) const {
    if (!failure_.empty()) return;
    constexpr double kSmall = 640.0 * 360.0;
    lab::PeerJob small = lab::peer_picture(kSmall, static_cast<double>(job.width) / job.height);
    small.threads = job.threads;
    small.max_depth = job.max_depth;
    small.picture = file;
    (void)start(small);
  }

  void run(const lab::PeerJob& job) {
    if (!failure_.empty() || player::interrupted()) return;
    const ProgramRun result = start(job);
    const auto seconds = lab::tachyon_seconds(result.output);
    if (result.timed_out)
      failure_ = fmt::format("ended after {} s, the limit", limit_s_);
    else if (result.exit_code != 0)
      failure_ = fmt::format("failed with exit code {}", result.exit_code);
    else if (!seconds || *seconds == 0.0)
      failure_ = "does not report its ray tracing time";
    else
      seconds_.push_back(*seconds);
  }

  [[nodiscard]] nlohmann::json row(const lab::PeerJob& job, double our_mray_s,
                                   double target) const {
    nlohmann::json row = {{"name", "Tachyon"}, {"runs", seconds_.size()}};
    if (!failure_.empty()) row["failure"] = failure_;
    if (seconds_.empty()) return row;
    const auto rays = static_cast<uint64_t>(job.width) * static_cast<uint64_t>(job.height);
    const double rate = mega_per_second(rays, median(seconds_));
    row.update({{"seconds", median(seconds_)},
                {"mray_s", rate},
                {"ours_over_theirs", rate > 0.0 ? our_mray_s / rate : 0.0},
                {"target", target},
                {"within_target", our_mray_s >= target * rate}});
    return row;
  }

 private:
  [[nodiscard]] ProgramRun start(const lab::PeerJob& job) const {
    std::vector<std::string> arguments = lab::tachyon_arguments(scene_file_, job);
    arguments.insert(arguments.begin(), program_);
    return player::run_child(arguments, std::chrono::seconds(limit_s_));
  }

  lab::ScratchFolder folder_;
  std::string scene_file_ = folder_.file("scene.nff");
  std::string program_;
  int limit_s_;
  std::vector<double> seconds_;
  std::string failure_;
};

}  // namespace

nlohmann::json measure_peers(const ExactFlags& flags, const std::string& scene) {
  BenchScene bench(exact_setup(flags, scene));
  const lab::PeerJob job = job_of(flags, bench);
  Tachyon tachyon(bench.description(), flags.peer_limit_s);
  if (!flags.peer_pictures.empty())
    tachyon.keep_picture(job,
                         fmt::format("{}/{}-tachyon.ppm", flags.peer_pictures, short_name(scene)));
  const auto method = bench.method(bench.options(flags.depth));
  std::vector<double> ours;
  for (int run = 0; run < flags.runs && !player::interrupted(); ++run) {
    ours.push_back(bench.render(*method).seconds);
    tachyon.run(job);
  }
  const double our_rate = mega_per_second(bench.subpixels(), median(ours));
  nlohmann::json rows = nlohmann::json::array();
  rows.push_back(tachyon.row(job, our_rate, lab::tachyon_target(short_name(scene))));
  return {{"scene", scene},         {"width", job.width},           {"height", job.height},
          {"threads", job.threads}, {"ours_seconds", median(ours)}, {"ours_mray_s", our_rate},
          {"rows", std::move(rows)}};
}

namespace {

void print_peers(const nlohmann::json& r) {
  print_out("{}: {} threads each; theirs a picture of {} x {}\n", r["scene"].get<std::string>(),
            r["threads"].get<int>(), r["width"].get<int>(), r["height"].get<int>());
  print_out("  {:<10} {:>8.2f} M primary rays/s {:>9.2f} s\n", "ours",
            r["ours_mray_s"].get<double>(), r["ours_seconds"].get<double>());
  for (const auto& row : r["rows"]) {
    print_out("  {:<10} ", row["name"].get<std::string>());
    if (row.contains("mray_s"))
      print_out("{:>8.3f} M primary rays/s {:>9.2f} s, ours {:.1f} x", row["mray_s"].get<double>(),
                row["seconds"].get<double>(), row["ours_over_theirs"].get<double>());
    if (row.contains("target") && row["target"].get<double>() > 0.0)
      print_out(" (at least {:.0f} x: {})", row["target"].get<double>(),
                row["within_target"].get<bool>() ? "met" : "missed");
    if (row.contains("failure"))
      print_out("{}{}", row.contains("mray_s") ? "; then " : "", row["failure"].get<std::string>());
    print_out("\n");
  }
}

// lenticule bench exact measures the cost of an exact frame relative to Embree alone.

nlohmann::json heading(const ExactFlags& flags) {
  const optics::Rig rig = lab::bench_rig(flags.rig);
  return {{"benchmark", "exact"},        {"machine", machine_json()},     {"rig", rig.name},
          {"width", rig.panel.width_px}, {"height", rig.panel.height_px}, {"depth", flags.depth},
          {"lights", flags.lights},      {"threads", flags.threads},      {"runs", flags.runs}};
}

void print_heading(const nlohmann::json& r) {
  print_out("machine   {}\n", machine_text());
  print_out("rig       {}, {}x{}\n", r["rig"].get<std::string>(), r["width"].get<int>(),
            r["height"].get<int>());
  const int lights = r["lights"].get<int>();
  print_out("frames    {} bounce(s), {}, medians of {} interleaved run(s)\n", r["depth"].get<int>(),
            lights == 0 ? "all lights" : fmt::format("at most {} lights", lights),
            r["runs"].get<int>());
}

/// Parts measures each part of the benchmark, stores it under its name, and prints it unless the
/// output is JSON.
class Parts {
 public:
  explicit Parts(const ExactFlags& flags) : flags_(flags), result_(heading(flags)) {
    if (!flags.json) print_heading(result_);
  }

  void per_scene(const char* name, nlohmann::json (*measure)(const ExactFlags&, const std::string&),
                 void (*print)(const nlohmann::json&)) {
    result_[name] = nlohmann::json::array();
    for (const std::string& scene : flags_.scenes) {
      if (player::interrupted()) return;
      nlohmann::json part = measure(flags_, bench_scene_name(scene));
      if (!player::interrupted()) keep(name, std::move(part), print);
    }
  }

  void several(const char* name, nlohmann::json (*measure)(const ExactFlags&),
               void (*print)(const nlohmann::json&)) {
    result_[name] = nlohmann::json::array();
    if (player::interrupted()) return;
    for (nlohmann::json& part : measure(flags_))
      if (!player::interrupted()) keep(name, std::move(part), print);
  }

  [[nodiscard]] const nlohmann::json& result() const { return result_; }

 private:
  void keep(const char* name, nlohmann::json part, void (*print)(const nlohmann::json&)) {
    if (!flags_.json) {
      print_out("\n");
      print(part);
      flush_results();  // the next part may take minutes
    }
    result_[name].push_back(std::move(part));
  }

  const ExactFlags& flags_;
  nlohmann::json result_;
};

void make_folder(const std::string& folder) {
  std::error_code error;
  if (!folder.empty()) std::filesystem::create_directories(folder, error);
  if (error)
    throw Error(ErrorKind::Failed, fmt::format("{}: cannot create: {}", folder, error.message()));
}

ExitCode run(ExactFlags flags) {
  flags.rates = flags.rates || !(flags.upright || flags.scaling || flags.growth || flags.peers);
  make_folder(flags.plots);
  make_folder(flags.peer_pictures);
  Parts parts(flags);
  if (flags.rates) parts.per_scene("scenes", measure_rates, print_rates);
  if (flags.upright) parts.per_scene("upright", measure_upright, print_upright);
  if (flags.scaling) parts.several("scaling", measure_scaling, print_growth);
  if (flags.growth) parts.several("growth", measure_growth, print_growth);
  if (flags.peers) parts.per_scene("peers", measure_peers, print_peers);
  if (player::interrupted()) return player::interrupt_exit_code();
  if (flags.json) print_json(parts.result());
  return kOk;
}

}  // namespace

cli::Run declare_bench_exact(CLI::App& app) {
  auto flags = std::make_shared<ExactFlags>();
  app.add_option("--scene", flags->scenes, "a built-in NAME[:SIZE], or as for render; repeatable")
      ->capture_default_str();
  declare_run_flags(app, *flags);
  declare_depth(app, "--depth", flags->depth);
  app.add_option("--lights", flags->lights, "use at most this many lights; 0 uses all")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  declare_threads(app, flags->threads);
  app.add_flag(
      "--rates", flags->rates,
      "measure bare Embree, visibility and whole frames (default if no other part is requested)");
  app.add_flag("--upright", flags->upright, "compare the slanted rig with an upright one");
  app.add_flag("--scaling", flags->scaling, "measure 1, 2, ... all threads");
  app.add_flag("--growth", flags->growth,
               "measure growing numbers of subpixels, triangles, lights and subpixels per lens");
  app.add_flag("--peers", flags->peers,
               "compare with Tachyon (scripts/packages bench installs it)");
  app.add_option("--peer-mrays", flags->peer_mrays,
                 "million primary rays of Tachyon's pictures; 0 means as many as subpixels")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  app.add_option("--peer-limit", flags->peer_limit_s,
                 "seconds after which a run of Tachyon is ended")
      ->check(CLI::Range(1, 86400))
      ->capture_default_str();
  app.add_option("--peer-pictures", flags->peer_pictures,
                 "folder for a small picture of each scene by Tachyon");
  app.add_option("--plots", flags->plots, "folder for plots of scaling and growth as SVG");
  return [flags]() -> ExitCode { return run(*flags); };
}
}  // namespace lenticule::bench
