// SPDX-License-Identifier: Apache-2.0
// Options of the render methods; docs/render/soft-light.md explains those of soft light.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <iterator>

#include "base/cpu.h"

#if defined(__x86_64__)
#include <x86intrin.h>
#endif

namespace lenticule::render {

// Counters and times of one rendered frame. A new counter is a field of FrameCounts and a line of
// kFrameCounters: sums over threads and frames, and the report of `lenticule render`, follow.

struct FrameCounts {
  uint64_t subpixels = 0;
  uint64_t primary_rays = 0;
  uint64_t primary_rays_culled = 0;  ///< part of primary_rays, culled: they meet nothing
  uint64_t lights_left_out = 0;      ///< lights that cannot contribute to any surface of the scene
  uint64_t shadow_rays = 0;
  uint64_t shadow_rays_culled = 0;   ///< part of shadow_rays, culled: unoccluded
  uint64_t shadow_rays_blocked = 0;  ///< part of shadow_rays, culled: occluded
  uint64_t secondary_rays = 0;
  uint64_t secondary_rays_culled = 0;    ///< part of secondary_rays, culled: no hit
  uint64_t secondary_rays_too_weak = 0;  ///< not traced, and not counted in secondary_rays: the
                                         ///< light cannot change a code value
  uint64_t rays_of_too_little = 0;       ///< not traced, see PacketTracer::tolerate()
  uint64_t ambient_rays = 0;             ///< rays that sample occlusion and the environment
  uint64_t ambient_rays_culled = 0;      ///< part of ambient_rays, culled: no geometry near
  uint64_t invalid_rays = 0;             ///< non-finite rays, which are not passed to Embree
  uint64_t suspected_holes = 0;  ///< primary rays that continued past the hits of their neighbours
  uint64_t filled_holes = 0;     ///< part of suspected_holes that had slipped between triangles
  // Origin of each subpixel's colour; the first four counters add up to `subpixels`.
  uint64_t traced_subpixels = 0;
  uint64_t projected_subpixels = 0;  ///< re-projected from points of other micro-images or frames
  uint64_t interpolated_subpixels = 0;  ///< mean of two neighbours, or interpolated between samples
  uint64_t copied_subpixels = 0;        ///< copied from a frame that had not changed
  uint64_t missing_subpixels = 0;      ///< left empty by re-projection, then traced or interpolated
  uint64_t retraced_subpixels = 0;     ///< retraced because an audit failed
  uint64_t audited_subpixels = 0;      ///< sampled at random and traced for the audit
  uint64_t audited_beyond = 0;         ///< part of audited_subpixels: error above tolerance
  uint64_t prefiltered_subpixels = 0;  ///< averaged over their footprint, except in mode Exhaustive
  uint64_t prefilter_rays = 0;  ///< part of primary_rays: additional rays of prefiltered_subpixels
  uint64_t prefilter_rays_left_out = 0;  ///< not traced: neighbours were alike

  /// Adds the counters of another thread or frame.
  FrameCounts& operator+=(const FrameCounts& other);
};

struct FrameCounter {
  const char* name;  ///< key in the statistics
  uint64_t FrameCounts::*field;
  /// Sum adds threads and frames; Largest is for figures of the scene.
  enum class Total { Sum, Largest } total = Total::Sum;
};

inline constexpr FrameCounter kFrameCounters[] = {
    {"subpixels", &FrameCounts::subpixels},
    {"primary_rays", &FrameCounts::primary_rays},
    {"primary_rays_culled", &FrameCounts::primary_rays_culled},
    {"lights_left_out", &FrameCounts::lights_left_out, FrameCounter::Total::Largest},
    {"shadow_rays", &FrameCounts::shadow_rays},
    {"shadow_rays_culled", &FrameCounts::shadow_rays_culled},
    {"shadow_rays_blocked", &FrameCounts::shadow_rays_blocked},
    {"secondary_rays", &FrameCounts::secondary_rays},
    {"secondary_rays_culled", &FrameCounts::secondary_rays_culled},
    {"secondary_rays_too_weak", &FrameCounts::secondary_rays_too_weak},
    {"rays_of_too_little", &FrameCounts::rays_of_too_little},
    {"ambient_rays", &FrameCounts::ambient_rays},
    {"ambient_rays_culled", &FrameCounts::ambient_rays_culled},
    {"invalid_rays", &FrameCounts::invalid_rays},
    {"suspected_holes", &FrameCounts::suspected_holes},
    {"filled_holes", &FrameCounts::filled_holes},
    {"traced_subpixels", &FrameCounts::traced_subpixels},
    {"projected_subpixels", &FrameCounts::projected_subpixels},
    {"interpolated_subpixels", &FrameCounts::interpolated_subpixels},
    {"copied_subpixels", &FrameCounts::copied_subpixels},
    {"missing_subpixels", &FrameCounts::missing_subpixels},
    {"retraced_subpixels", &FrameCounts::retraced_subpixels},
    {"audited_subpixels", &FrameCounts::audited_subpixels},
    {"audited_beyond", &FrameCounts::audited_beyond},
    {"prefiltered_subpixels", &FrameCounts::prefiltered_subpixels},
    {"prefilter_rays", &FrameCounts::prefilter_rays},
    {"prefilter_rays_left_out", &FrameCounts::prefilter_rays_left_out},
};
static_assert(std::size(kFrameCounters) * sizeof(uint64_t) == sizeof(FrameCounts),
              "each field has a line");

inline FrameCounts& FrameCounts::operator+=(const FrameCounts& other) {
  for (const FrameCounter& counter : kFrameCounters) {
    uint64_t& mine = this->*counter.field;
    const uint64_t theirs = other.*counter.field;
    mine = counter.total == FrameCounter::Total::Sum ? mine + theirs : std::max(mine, theirs);
  }
  return *this;
}

/// Kinds of work of a worker thread.
enum class Work : uint8_t {
  MakeRays,        ///< optics: from subpixels to ray packets
  TracePrimary,    ///< Embree
  Shade,           ///< surfaces, lights, new rays
  TraceShadows,    ///< Embree
  TraceSecondary,  ///< Embree: mirrored and refracted rays
  Write,           ///< conversion of light to bytes
  Idle,
};
inline constexpr size_t kWorks = static_cast<size_t>(Work::Idle) + 1;

/// WorkClock measures the work of one thread. If enabled, it reads the processor's time stamp
/// counter at each change of work, which costs a few nanoseconds.
class WorkClock {
 public:
  explicit WorkClock(bool on) : on_(on), last_(on ? now() : 0) {}

  void turn_to(Work work) {
    if (!on_) return;
    const uint64_t time = now();
    ticks_[static_cast<size_t>(current_)] += time - last_;
    last_ = time;
    current_ = work;
  }
  /// Returns the time per kind of work in ticks of unspecified length; only their ratios are
  /// meaningful.
  [[nodiscard]] const std::array<uint64_t, kWorks>& ticks() const { return ticks_; }

 private:
  static uint64_t now() {
#if defined(__x86_64__)
    return __rdtsc();
#else
    return static_cast<uint64_t>(std::chrono::steady_clock::now().time_since_epoch().count());
#endif
  }

  bool on_;
  uint64_t last_;
  Work current_ = Work::Idle;
  std::array<uint64_t, kWorks> ticks_{};
};

/// FrameErrors describes the errors of a frame of method adaptive; all are 0 without an audit.
struct FrameErrors {
  /// Upper bound, with 99.99 % confidence, of the share of all subpixels whose error exceeds the
  /// tolerated error.
  double beyond_bound = 0.0;
  /// Root mean square error of the audited subpixels in code values. That of the frame may be many
  /// times larger: few subpixels that are off by much are rarely among the audited ones.
  double audited_rmse = 0.0;
  /// Upper bound, with 99 % confidence, of the root mean square error of all subpixels.
  double rmse_bound = 0.0;
};

/// RenderStatistics describes the cost of one frame. Times are wall-clock seconds.
struct RenderStatistics : FrameCounts, FrameErrors {
  bool completed = true;
  double seconds = 0.0;
  /// Shares of the workers' time per kind of work; they add up to 1, or are zero if not measured.
  std::array<double, kWorks> work{};

  /// Adds counters and time of another frame, and keeps the larger errors and bounds.
  void add(const RenderStatistics& frame) {
    *this += frame;
    beyond_bound = std::max(beyond_bound, frame.beyond_bound);
    audited_rmse = std::max(audited_rmse, frame.audited_rmse);
    rmse_bound = std::max(rmse_bound, frame.rmse_bound);
    seconds += frame.seconds;
  }
};

/// SoftLight holds ray counts and sizes of soft lighting. Ray counts are per shaded point, at every
/// bounce.
struct SoftLight {
  /// Rays toward each area light; 0 = hard shadows.
  int shadow_samples = 0;
  /// Radius of point and spot lights, in millimetres on the panel; 0 = hard shadows.
  double light_radius_mm = 20.0;
  /// Angular radius of directional lights, as seen from the scene, in degrees; 0 = hard shadows.
  double sun_radius_degrees = 1.5;
  /// Rays that sample the occlusion of the flat ambient light, which reaches a point only along
  /// rays that meet nothing; 0 = no occlusion.
  int occlusion_samples = 0;
  /// Length of the occlusion rays, in millimetres on the panel; may be infinite.
  double occlusion_distance_mm = 50.0;
  /// Rays toward the environment, whose light then replaces the flat ambient light; 0 = flat.
  int environment_samples = 0;

  [[nodiscard]] bool samples_ambient() const {
    return occlusion_samples > 0 || environment_samples > 0;
  }
  [[nodiscard]] bool any() const { return shadow_samples > 0 || samples_ambient(); }
};

/// Checks the options. Throws Error(Usage) for numbers that are negative, too large or not finite,
/// and if both occlusion and environment samples are requested.
void validate(const SoftLight& soft);

/// Prefilter selects the subpixels that are averaged over their footprint; all others are sampled
/// with one ray through the centre.
enum class Prefilter {
  Off,         ///< none
  Depth,       ///< content beyond the depth of field, unless the neighbourhood is uniform
  Beam,        ///< all content, unless the neighbourhood is uniform
  Exhaustive,  ///< all content, always with the full number of rays: reference for the other modes
};

struct RenderOptions {
  int threads = 0;  ///< 0 = all cores
  int samples = 1;  ///< per subpixel, inside its angular footprint; 1 = the centre
  /// Subpixels that method `full` averages over their footprint. Requires samples == 1.
  Prefilter prefilter = Prefilter::Off;
  int prefilter_samples = 17;  ///< rays per averaged subpixel; an upper limit except for Exhaustive
  int max_depth = 5;           ///< maximum number of reflections and refractions along a path
  SoftLight soft{};            ///< area lights and ambient light
  Isa isa = best_isa();  ///< instruction set of our own kernels; the bytes do not depend on it
  /// Rays that a conservative test culls as meeting nothing are not traced
  /// (render/culling/shaft.h); the bytes are the same.
  bool use_shaft_culling = true;
  /// Mirrored rays that cannot change the code value of their subpixel, no matter which surface
  /// they hit, are not traced; the bytes are the same. Only with one sample per subpixel.
  bool skip_weak_rays = true;
  double tolerated_error = 2.0;  ///< method adaptive: tolerated error in code values
  /// Method adaptive: limit of each frame's root mean square error in code values, proven by the
  /// audit. 0: none; the audit aims at twice the tolerated error.
  double proven_rmse = 0.0;
  /// Primary rays that a conservative test culls as meeting nothing are not traced
  /// (render/culling/background.h); the bytes are the same.
  bool skip_background = true;
  /// Frames whose scene and stage equal the previous frame's are copied instead of rendered.
  /// Applies to method full, and to method adaptive, which also reuses unchanged regions
  /// (docs/render/rendering.md). Off by default, since benchmarks render the same frame repeatedly.
  bool copy_unchanged = false;
  bool tiles_backwards = false;  ///< order of the tiles, for tests: the bytes do not depend on it
  bool keep_missing = false;     ///< fill Method::missing_subpixels()
  bool measure_work = false;     ///< fill RenderStatistics::work; costs some percent of time
  /// Called between tiles; returning true ends the frame early (then RenderStatistics::completed is
  /// false).
  std::function<bool()> cancelled;
};

/// Returns the size of oneTBB's arena for RenderOptions::threads, which may be above the number of
/// cores.
[[nodiscard]] int arena_threads(int threads);

}  // namespace lenticule::render
