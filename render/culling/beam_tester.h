// SPDX-License-Identifier: Apache-2.0
// Conservative tests that bundles of primary rays meet nothing.
#pragma once

#include "render/culling/primitive_tree.h"
#include "render/rays/beam.h"

namespace lenticule::render {

/// Of one scene, which must outlive it; for any thread.
class BeamTester {
 public:
  explicit BeamTester(const Scene& scene);

  /// False: no proof can be had, since the scene has too many primitives for a tree, or is put on
  /// the glass askew or a million times deeper or flatter than it is.
  [[nodiscard]] bool usable() const { return usable_; }

  /// True: no ray of the beam meets anything, Embree's roundings included. False: one may.
  [[nodiscard]] bool empty(const Beam& beam) const;

 private:
  [[nodiscard]] Vec3 on_panel(Vec3f point) const;
  [[nodiscard]] bool misses_box(const Beam& beam, Vec3f low, Vec3f high) const;
  [[nodiscard]] bool misses_primitive(const Beam& beam, const PrimitiveTree::Leaf& leaf) const;

  const Scene& scene_;
  bool usable_ = false;
  Vec3 panel_per_scene_;  ///< along each axis
  double margin_ = 0.0;   ///< of sizes
};

}  // namespace lenticule::render
