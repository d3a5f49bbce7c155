// SPDX-License-Identifier: Apache-2.0
// Proofs that whole bundles of rays meet nothing, or that each of them meets something, so that
// none of them needs to be traced.
//
// A shaft is every ray that leaves a small patch of a surface toward one point or into one ball,
// within a narrow cone of directions, or in any direction but no farther than some length. It is
// empty if each primitive of the scene can be separated from its convex hull by a plane; what
// cannot be separated by the few planes that are tried counts as in the way, so that the answer
// errs on the side of tracing. It is blocked if one primitive alone is in the way of all its rays.
// Margins cover single precision's roundings, also Embree's.
#pragma once

#include <cstdint>

#include "render/culling/primitive_tree.h"
#include "render/scene/scene.h"
#include "render/scene/surface_cells.h"

namespace lenticule::render {

/// A cell of a surface, as a place where rays start.
struct Patch {
  Vec3f centre{};
  float radius = 0.0F;  ///< of a ball around all of it
  /// Rays leave to this side of the plane normal . p = height, where the patch is flat.
  bool flat = false;
  Vec3f normal{};
  float height = 0.0F;
  /// The same plane in double precision, for wide triangles.
  Vec3 exact_normal{};
  double exact_height = 0.0;
  /// Rays that leave along the plane are above it at least that far.
  float level = 0.0F;
  /// Rays cannot meet the primitive that they leave.
  bool leaves_convex = false;
  uint32_t geometry = 0;
  uint32_t primitive = 0;
};

/// Which part of the surface `cell` is.
[[nodiscard]] Patch patch_of(const Scene& scene, const SurfaceCell& cell);

struct Shaft {
  Patch from{};
  bool to_point = false;
  Vec3f point{};      ///< where all rays end, or the middle of the ball in which they do
  float ball = 0.0F;  ///< its radius
  Vec3f axis{};       ///< unit: the middle of the cone of directions
  float sine = 0.0F;  ///< of half its opening, below a right angle
  float cosine = 1.0F;
  float within = 0.0F;  ///< if not zero: the length of rays of any direction
};
[[nodiscard]] Shaft shaft_to_point(const Patch& from, Vec3 point);
[[nodiscard]] Shaft shaft_to_ball(const Patch& from, Vec3 middle, double radius);
[[nodiscard]] Shaft shaft_in_cone(const Patch& from, Vec3f axis, float cosine);
[[nodiscard]] Shaft shaft_around(const Patch& from, double length);

/// Immutable after construction; for any thread. Refers to the scene, whose shapes must stay.
class ShaftTester {
 public:
  /// Both must outlive it; the tree is the scene's.
  ShaftTester(const Scene& scene, const PrimitiveTree& tree);

  /// True: no ray of the shaft meets anything. False: one may.
  [[nodiscard]] bool empty(const Shaft& shaft) const;
  /// True: every ray of the shaft meets something before its end. False: one may not. Always
  /// false for shafts that have no end, and where only several primitives together block.
  [[nodiscard]] bool blocked(const Shaft& shaft) const;

 private:
  const Scene& scene_;
  const PrimitiveTree& tree_;
};

}  // namespace lenticule::render
