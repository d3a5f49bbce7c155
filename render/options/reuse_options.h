// SPDX-License-Identifier: Apache-2.0
// Options of the methods that reuse points. The defaults were chosen by measurement (`lenticule
// bench reuse`); the alternatives exist for comparison.
#pragma once

namespace lenticule::render {

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

}  // namespace lenticule::render
