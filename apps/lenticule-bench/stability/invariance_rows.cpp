// SPDX-License-Identifier: Apache-2.0
// Tests that the picture depends neither on the position of the world's origin nor on the unit.
#include <fmt/format.h>

#include <cstdlib>

#include "apps/lenticule-bench/stability/rows.h"
#include "apps/lenticule-bench/stability/small_scenes.h"
#include "apps/lenticule-bench/stability/tally.h"

namespace lenticule::bench {
namespace {

constexpr double kMmPerUnit = 12.0;

optics::Rig rig_of(const StabilitySize& size) {
  return finer(small_rig(), size.full ? 8 : 1);
}

frames::WovenFrame picture(const StabilitySize& size, double scale, Vec3 offset) {
  return render_small(moved(mixed_scene(), scale, offset), plain_stage(offset, kMmPerUnit / scale),
                      rig_of(size), size.threads);
}

/// Counts codes that differ by more than one, and records the largest difference.
Tally difference(const frames::WovenFrame& a, const frames::WovenFrame& b) {
  Tally tally;
  for (size_t k = 0; k < a.bytes().size(); ++k) {
    const int off = std::abs(int{a.bytes()[k]} - int{b.bytes()[k]});
    tally.check(off <= 1);
  }
  return tally;
}

/// Returns a row with a small number of allowed failures: rounded world coordinates may move the
/// outline of an object across a subpixel's ray.
StabilityRow filled(const Tally& tally, const char* stressed, std::string note) {
  return {.stressed = stressed,
          .samples = tally.samples,
          .samples_are = "subpixels",
          .failures = tally.failures,
          .failures_allowed = tally.samples / 20000,
          .failures_are = "other by more than one code",
          .note = std::move(note)};
}

}  // namespace

StabilityRow stability_offsets(const StabilitySize& size) {
  const frames::WovenFrame at_home = picture(size, 1.0, {});
  Tally sum;
  std::string note = "by offset:";
  for (const double offset : {1e3, 1e4, 1e5, 1e6, 1e7}) {
    const Tally tally =
        difference(at_home, picture(size, 1.0, Vec3{offset, -0.7 * offset, 0.4 * offset}));
    note += fmt::format(" {}", tally.failures);
    sum += tally;
  }
  return filled(sum, "a scene 6 units wide moved by 10^3 to 10^7 units", note);
}

StabilityRow stability_scales(const StabilitySize& size) {
  const frames::WovenFrame at_home = picture(size, 1.0, {});
  Tally sum;
  std::string note = "by scale:";
  for (const double scale : {1e-6, 1e-3, 7.0, 1e3, 1e6}) {
    const Tally tally = difference(at_home, picture(size, scale, {}));
    note += fmt::format(" {}", tally.failures);
    sum += tally;
  }
  return filled(sum, "the same scene in units of 10^-6 to 10^6", note);
}

}  // namespace lenticule::bench
