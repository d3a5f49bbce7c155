// SPDX-License-Identifier: Apache-2.0
// Options shared by all render methods.
#pragma once

#include <functional>

#include "base/cpu.h"
#include "render/options/reuse_options.h"
#include "render/options/soft_light.h"

namespace lenticule::render {

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
  ReuseOptions reuse{};          ///< options of the methods that reuse points
  bool keep_missing = false;     ///< fill Method::missing_subpixels()
  bool measure_work = false;     ///< fill RenderStatistics::work; costs some percent of time
  /// Called between tiles; returning true ends the frame early (then RenderStatistics::completed is
  /// false).
  std::function<bool()> cancelled;
};

}  // namespace lenticule::render
