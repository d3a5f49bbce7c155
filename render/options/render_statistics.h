// SPDX-License-Identifier: Apache-2.0
// Counters and times of one rendered frame.
#pragma once

#include <array>
#include <cstdint>

#include "render/options/work_clock.h"

namespace lenticule::render {

/// What one frame cost. Times are wall seconds.
struct RenderStatistics {
  bool completed = true;
  uint64_t subpixels = 0;
  uint64_t primary_rays = 0;
  uint64_t shadow_rays = 0;
  uint64_t secondary_rays = 0;
  uint64_t ambient_rays = 0;             ///< of sampled occlusion and surroundings
  uint64_t ambient_rays_proved = 0;      ///< of ambient_rays: not traced, nothing was near
  uint64_t invalid_rays = 0;             ///< not finite, so not shown to Embree
  uint64_t suspected_holes = 0;          ///< primary rays that went on where their neighbours ended
  uint64_t filled_holes = 0;             ///< and those that had slipped between triangles
  uint64_t primary_rays_proved = 0;      ///< of primary_rays: not traced, they meet nothing
  uint64_t lights_left_out = 0;          ///< they bring nothing to anything in the scene
  uint64_t shadow_rays_proved = 0;       ///< of shadow_rays: not traced, nothing was in their way
  uint64_t shadow_rays_blocked = 0;      ///< of shadow_rays: not traced, something surely was
  uint64_t secondary_rays_proved = 0;    ///< of secondary_rays: not traced, they meet nothing
  uint64_t secondary_rays_too_weak = 0;  ///< left out, and not counted in secondary_rays
  uint64_t rays_of_too_little = 0;       ///< left out by method adaptive, within its error
  // How subpixels got their colour; the first four add up to `subpixels`.
  uint64_t traced_subpixels = 0;
  uint64_t projected_subpixels = 0;     ///< from points of other micro-images or frames
  uint64_t interpolated_subpixels = 0;  ///< the mean of two neighbours
  uint64_t copied_subpixels = 0;        ///< of a frame in which nothing had changed
  uint64_t mended_subpixels = 0;        ///< traced after all, since an audit failed
  uint64_t audited_subpixels = 0;       ///< drawn at random and traced, too
  uint64_t audited_beyond = 0;          ///< of those: off by more than the tolerated error
  /// With 99 % confidence no larger a share of all subpixels is off by more than that.
  double beyond_bound = 0.0;
  uint64_t prefiltered_subpixels = 0;    ///< averaged over their beams, but for Exhaustive
  uint64_t prefilter_rays = 0;           ///< of primary_rays: for those, beside the middle ones
  uint64_t prefilter_rays_left_out = 0;  ///< not traced: neighbours were alike
  uint64_t missing_subpixels = 0;  ///< found empty by re-projection, then traced or interpolated
  double seconds = 0.0;
  /// Shares of the workers' time, which add up to 1; zeros unless they were asked for.
  std::array<double, kWorks> work{};
};

}  // namespace lenticule::render
