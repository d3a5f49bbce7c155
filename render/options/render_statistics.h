// SPDX-License-Identifier: Apache-2.0
// Counters and times of one rendered frame.
#pragma once

#include <array>
#include <cstdint>

#include "render/options/work_clock.h"

namespace lenticule::render {

/// RenderStatistics describes the cost of one frame. Times are wall-clock seconds.
struct RenderStatistics {
  bool completed = true;
  uint64_t subpixels = 0;
  uint64_t primary_rays = 0;
  uint64_t shadow_rays = 0;
  uint64_t secondary_rays = 0;
  uint64_t ambient_rays = 0;         ///< rays that sample occlusion and the environment
  uint64_t ambient_rays_proved = 0;  ///< part of ambient_rays, culled: no geometry near
  uint64_t invalid_rays = 0;         ///< non-finite rays, which are not passed to Embree
  uint64_t suspected_holes = 0;  ///< primary rays that continued past the hits of their neighbours
  uint64_t filled_holes = 0;     ///< part of suspected_holes that had slipped between triangles
  uint64_t primary_rays_proved = 0;  ///< part of primary_rays, culled: they meet nothing
  uint64_t lights_left_out = 0;      ///< lights that cannot contribute to any surface of the scene
  uint64_t shadow_rays_proved = 0;   ///< part of shadow_rays, culled: unoccluded
  uint64_t shadow_rays_blocked = 0;  ///< part of shadow_rays, culled: occluded
  uint64_t secondary_rays_proved = 0;    ///< part of secondary_rays, culled: no hit
  uint64_t secondary_rays_too_weak = 0;  ///< not traced, and not counted in secondary_rays
  uint64_t rays_of_too_little = 0;       ///< skipped by method adaptive within its error
  // Origin of each subpixel's colour; the first four counters add up to `subpixels`.
  uint64_t traced_subpixels = 0;
  uint64_t projected_subpixels = 0;  ///< re-projected from points of other micro-images or frames
  uint64_t interpolated_subpixels = 0;  ///< mean of two neighbours
  uint64_t copied_subpixels = 0;        ///< copied from a frame that had not changed
  uint64_t mended_subpixels = 0;        ///< retraced because an audit failed
  uint64_t audited_subpixels = 0;       ///< sampled at random and traced for the audit
  uint64_t audited_beyond = 0;          ///< part of audited_subpixels: error above tolerance
  /// Upper bound, with 99 % confidence, of the share of all subpixels whose error exceeds the
  /// tolerated error.
  double beyond_bound = 0.0;
  uint64_t prefiltered_subpixels = 0;  ///< averaged over their footprint, except in mode Exhaustive
  uint64_t prefilter_rays = 0;  ///< part of primary_rays: additional rays of prefiltered_subpixels
  uint64_t prefilter_rays_left_out = 0;  ///< not traced: neighbours were alike
  uint64_t missing_subpixels = 0;  ///< left empty by re-projection, then traced or interpolated
  double seconds = 0.0;
  /// Shares of the workers' time per kind of work; they add up to 1, or are zero if not measured.
  std::array<double, kWorks> work{};
};

}  // namespace lenticule::render
