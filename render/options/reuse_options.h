// SPDX-License-Identifier: Apache-2.0
// How the methods that reuse points do it. The defaults were chosen by measurement
// (`lenticule bench reuse`); the other ways are there to be compared with.
#pragma once

namespace lenticule::render {

struct ReuseOptions {
  /// How a subpixel gets its colour from points that were seen through another lens.
  enum class Reconstruction {
    Chords,   ///< between the two points on both sides of its ray, if they belong together
    Nearest,  ///< from the point nearest to it, as it is
  };
  Reconstruction reconstruction = Reconstruction::Chords;
  /// Every so many micro-images one is traced whole, and those between are made from the traced
  /// ones on both sides. 0: each is made from the one before it, whatever that was made of.
  int key_every = 2;
  bool occlusion = true;  ///< the nearest point or chord wins, and hides what it hides
  /// Points of mirrors, glass and highlights are reused like others.
  bool reuse_glossy = true;
  bool one_side = true;  ///< what only one of the two neighbours shows is taken
  /// Code values that the two points of a chord, or the two neighbours, may differ by.
  float agreement = 16.0F;
  /// Code values that the two neighbours of a mean may differ by; beyond, it is traced.
  float mean_agreement = 16.0F;
  float steepest = 4.0F;  ///< depth per width of a chord
  /// Every so many frames one is traced whole, counted from frame 0; sequences agree on them
  /// wherever they are begun.
  int key_frames = 16;
  /// A picture that moves farther than this part of the panel's diagonal from one frame to the next
  /// is another picture.
  double cut = 1.0 / 16.0;
  float within = 0.5F;  ///< Nearest: distance of a point from the ray, in slots of its channel
};

/// As literally as the paper can be read: each micro-image from the one before it, every point
/// taken for the subpixel that is nearest, nothing hidden, any two colours meant.
[[nodiscard]] inline ReuseOptions literal_reuse() {
  ReuseOptions reuse;
  reuse.reconstruction = ReuseOptions::Reconstruction::Nearest;
  reuse.key_every = 0;
  reuse.occlusion = false;
  reuse.agreement = reuse.mean_agreement = 255.0F;
  return reuse;
}

}  // namespace lenticule::render
