// SPDX-License-Identifier: Apache-2.0
// The options that all render methods share.
#pragma once

#include <functional>

#include "base/cpu.h"
#include "render/options/reuse_options.h"
#include "render/options/soft_light.h"

namespace lenticule::render {

/// What is averaged over its beam; all else is one ray, through the middle.
enum class Prefilter {
  Off,         ///< nothing
  Depth,       ///< what is seen beyond the depth of field, unless all around it looks the same
  Beam,        ///< everything, unless all around it looks the same
  Exhaustive,  ///< everything, always with as many rays: what the others are measured against
};

struct RenderOptions {
  int threads = 0;  ///< 0 = all cores
  int samples = 1;  ///< per subpixel, inside its angular footprint; 1 = the centre
  /// What is averaged over the beam of its subpixel, of method full; with one of `samples`.
  Prefilter prefilter = Prefilter::Off;
  int prefilter_samples = 17;  ///< rays of such a subpixel; but for Exhaustive, at most
  int max_depth = 5;           ///< of reflections and refractions
  SoftLight soft{};            ///< lamps that have a size, light from all around
  Isa isa = best_isa();        ///< of our own loops; the bytes do not depend on it
  /// Rays that are proved to meet nothing are not traced (render/culling/shaft.h); the bytes are
  /// the same.
  bool use_shaft_proofs = true;
  /// Mirrored rays that cannot change their subpixel's code value, whatever they meet, are left
  /// out; the bytes are the same. Only with one sample per subpixel.
  bool skip_weak_rays = true;
  double tolerated_error = 2.0;  ///< code values, of method adaptive
  /// Primary rays that are proved to meet nothing are not traced (render/culling/background.h); the
  /// bytes are the same.
  bool skip_background = true;
  /// Frames whose scene and stage are those of the frame before are copied, not rendered. Methods
  /// full and adaptive, which keeps parts, too (docs/rendering.md). Off unless asked for, since
  /// whoever times frames renders one again and again.
  bool copy_unchanged = false;
  bool tiles_backwards = false;  ///< the bytes do not depend on the order; for tests
  ReuseOptions reuse{};          ///< of the methods that reuse points
  bool keep_missing = false;     ///< make Method::missing_subpixels()
  bool measure_work = false;     ///< fill RenderStatistics::work; costs some percent of time
  /// Asked between tiles; true ends the frame early (RenderStatistics::completed is false then).
  std::function<bool()> cancelled;
};

}  // namespace lenticule::render
