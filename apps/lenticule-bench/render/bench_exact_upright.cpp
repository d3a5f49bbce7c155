// SPDX-License-Identifier: Apache-2.0
// lenticule bench exact --upright measures the additional cost of slanted lenses of fractional
// pitch over upright ones.

#include <cmath>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_timing.h"
#include "apps/lenticule-bench/render/bench_exact.h"
#include "base/print.h"

namespace lenticule::bench {
namespace {

constexpr double kTarget = 1.35;

}  // namespace

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

}  // namespace lenticule::bench
