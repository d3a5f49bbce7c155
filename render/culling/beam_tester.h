// SPDX-License-Identifier: Apache-2.0
// BeamTester does conservative tests that bundles of primary rays meet nothing.
#pragma once

#include "render/culling/primitive_tree.h"
#include "render/rays/beam.h"

namespace lenticule::render {

/// BeamTester tests beams against one scene. Lifetime: the scene must outlive the object. Thread
/// safety: usable from any thread.
class BeamTester {
 public:
  explicit BeamTester(const Scene& scene);

  /// Returns false if no beam can be tested: the scene has too many primitives for a tree, or the
  /// stage shears it or scales its depth by more than a factor of a million.
  [[nodiscard]] bool usable() const { return usable_; }

  /// Returns true if no ray of the beam meets anything, including Embree's rounding errors; false
  /// if a ray may meet something.
  [[nodiscard]] bool empty(const Beam& beam) const;

 private:
  [[nodiscard]] Vec3 on_panel(Vec3f point) const;
  [[nodiscard]] bool misses_box(const Beam& beam, Vec3f low, Vec3f high) const;
  [[nodiscard]] bool misses_primitive(const Beam& beam, const PrimitiveTree::Leaf& leaf) const;

  const Scene& scene_;
  bool usable_ = false;
  Vec3 panel_per_scene_;  ///< panel units per scene unit, along each axis
  double margin_ = 0.0;   ///< allowance for rounding, relative to sizes
};

/// Returns true if no ray of the beam, or of its extension toward the viewer, crosses the ground
/// where the scene's shadow falls. The scene must have one.
[[nodiscard]] bool misses_ground_shadow(const Scene& scene, const Beam& beam);

}  // namespace lenticule::render
