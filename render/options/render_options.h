// SPDX-License-Identifier: Apache-2.0
// Options of the render methods; docs/render/soft-light.md explains those of soft light.
#pragma once

#include <functional>

#include "base/cpu.h"

namespace lenticule::render {

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

/// ReuseOptions are those of the methods that reuse points. The defaults were chosen by measurement
/// (`lenticule bench reuse`); the alternatives exist for comparison.
struct ReuseOptions {
  /// Reconstruction selects the way in which a subpixel gets its colour from points seen through
  /// another lens.
  enum class Reconstruction {
    Chords,   ///< interpolates between the points on both sides of the ray, if they belong together
    Nearest,  ///< takes the colour of the nearest point
  };
  Reconstruction reconstruction = Reconstruction::Chords;
  /// Every key_every-th micro-image is traced completely, and those between are made from the
  /// traced ones on both sides. 0: each micro-image is made from the one before it, even if that
  /// one was not traced.
  int key_every = 2;
  bool occlusion = true;  ///< the nearest point or chord wins and occludes the others
  /// Points on reflective, transparent and highlighted surfaces are reused like others.
  bool reuse_glossy = true;
  bool one_side = true;  ///< content that only one of the two neighbours shows is used
  /// Largest difference in code values between the two points of a chord, or between the two
  /// neighbours.
  float agreement = 16.0F;
  /// Largest difference in code values between the two neighbours whose mean is taken; above it,
  /// the subpixel is traced.
  float mean_agreement = 16.0F;
  float steepest = 4.0F;  ///< largest depth per width of a chord
  /// Every key_frames-th frame is traced completely, counted from frame 0, so that a sequence has
  /// the same traced frames no matter at which frame it is started.
  int key_frames = 16;
  /// A picture that moves farther than this fraction of the panel's diagonal between two frames is
  /// treated as a new picture.
  double cut = 1.0 / 16.0;
  float within = 0.5F;  ///< Nearest: largest distance of a point from the ray, in slots
};

/// Returns the most literal reading of the paper: each micro-image is made from the one before it,
/// every point goes to the nearest subpixel, there is no occlusion, and any two colours are
/// averaged.
[[nodiscard]] inline ReuseOptions literal_reuse() {
  ReuseOptions reuse;
  reuse.reconstruction = ReuseOptions::Reconstruction::Nearest;
  reuse.key_every = 0;
  reuse.occlusion = false;
  reuse.agreement = reuse.mean_agreement = 255.0F;
  return reuse;
}

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
