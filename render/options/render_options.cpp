// SPDX-License-Identifier: Apache-2.0
#include "render/options/render_options.h"

#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>

#include <cstddef>

#include "base/error.h"

namespace lenticule::render {
namespace {

constexpr int kMostSamples = 4096;
constexpr double kLargestLight = 1e6;
constexpr double kLargestSun = 60.0;
constexpr size_t kMostThreads = 1024;

/// Without it oneTBB starts no more threads than the machine has cores; it prints a warning if it
/// is made after the first use of oneTBB.
const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, kMostThreads);

void check_count(const char* what, int count) {
  if (count < 0 || count > kMostSamples)
    throw Error(ErrorKind::Usage, fmt::format("{} {}: not in 0 ... {}", what, count, kMostSamples));
}

/// Throws Error(Usage) unless size is in [0, most]; NaN is rejected, too.
void check_size(const char* what, double size, double most, const char* unit) {
  if (!(size >= 0.0 && size <= most))
    throw Error(ErrorKind::Usage,
                fmt::format("{} {}: not in 0 ... {:g} {}", what, size, most, unit));
}

}  // namespace

void validate(const SoftLight& soft) {
  check_count("soft shadow samples", soft.shadow_samples);
  check_count("occlusion samples", soft.occlusion_samples);
  check_count("environment samples", soft.environment_samples);
  check_size("light size", soft.light_radius_mm, kLargestLight, "mm");
  check_size("sun size", soft.sun_radius_degrees, kLargestSun, "degrees");
  if (!(soft.occlusion_distance_mm > 0.0))
    throw Error(ErrorKind::Usage,
                fmt::format("occlusion distance {}: not above 0 mm", soft.occlusion_distance_mm));
  if (soft.occlusion_samples > 0 && soft.environment_samples > 0)
    throw Error(ErrorKind::Usage, "occlusion: cannot be combined with environment light",
                "use one of the two; environment light includes occlusion");
}

int arena_threads(int threads) { return threads > 0 ? threads : tbb::task_arena::automatic; }

}  // namespace lenticule::render
