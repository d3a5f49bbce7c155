// SPDX-License-Identifier: Apache-2.0
// Conservative tests that a whole bundle of rays meets nothing, or that each ray of the bundle
// meets something, so that none of the rays needs to be traced. The bundles are shafts (Haines and
// Wallace, "Shaft Culling for Efficient Ray-Traced Radiosity", 1991).
//
// A shaft consists of all rays that leave a small patch of a surface toward one point, into one
// ball, within a narrow cone of directions, or in any direction up to a given length. A shaft is
// empty if every primitive of the scene can be separated from the shaft's convex hull by a plane. A
// primitive that none of the few tried planes separates counts as possibly in the way, so errors
// are on the side of tracing. A shaft is blocked if a single primitive intersects all its rays.
// Margins cover the roundings of single precision, including Embree's.
#pragma once

#include <cstdint>

#include "render/culling/primitive_tree.h"
#include "render/scene/scene.h"
#include "render/scene/surface_cells.h"

namespace lenticule::render {

/// Patch is a surface cell as the origin of rays.
struct Patch {
  Vec3f centre{};
  float radius = 0.0F;  ///< radius of a ball that contains the patch
  /// A flat patch lies in the plane normal . p = height; rays leave to its positive side.
  bool flat = false;
  Vec3f normal{};
  float height = 0.0F;
  /// The same plane in double precision, for tests against wide triangles.
  Vec3 exact_normal{};
  double exact_height = 0.0;
  /// Lower bound of the height above the plane of rays that leave along the plane.
  float level = 0.0F;
  /// Rays cannot meet the primitive that they leave.
  bool leaves_convex = false;
  uint32_t geometry = 0;
  uint32_t primitive = 0;
};

/// Returns the part of the surface that `cell` covers.
[[nodiscard]] Patch patch_of(const Scene& scene, const SurfaceCell& cell);

struct Shaft {
  Patch from{};
  bool to_point = false;
  Vec3f point{};      ///< end of all rays, or the centre of the ball in which the rays end
  float ball = 0.0F;  ///< radius of the ball
  Vec3f axis{};       ///< unit; centre of the cone of directions
  float sine = 0.0F;  ///< sine of half the cone's opening, which is below a right angle
  float cosine = 1.0F;
  float within = 0.0F;  ///< if not zero, the shaft holds rays of this length in any direction
};
[[nodiscard]] Shaft shaft_to_point(const Patch& from, Vec3 point);
[[nodiscard]] Shaft shaft_to_ball(const Patch& from, Vec3 middle, double radius);
[[nodiscard]] Shaft shaft_in_cone(const Patch& from, Vec3f axis, float cosine);
[[nodiscard]] Shaft shaft_around(const Patch& from, double length);

/// ShaftTester tests shafts against a scene. Thread safety: immutable after construction, usable
/// from any thread.
class ShaftTester {
 public:
  /// Lifetime: `scene` and its tree `tree` must outlive the object.
  ShaftTester(const Scene& scene, const PrimitiveTree& tree);

  /// Returns true if no ray of the shaft meets anything; false if a ray may.
  [[nodiscard]] bool empty(const Shaft& shaft) const;
  /// Returns true if every ray of the shaft meets something before its end; false if a ray may not.
  /// Always false for shafts without an end, and if only several primitives together block the
  /// rays.
  [[nodiscard]] bool blocked(const Shaft& shaft) const;

 private:
  const Scene& scene_;
  const PrimitiveTree& tree_;
};

}  // namespace lenticule::render
