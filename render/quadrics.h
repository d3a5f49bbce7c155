// SPDX-License-Identifier: Apache-2.0
// Spheres and open cones met by rays, in closed form and double precision.
#pragma once

#include "optics/vec.h"

namespace lenticule::render {

struct SphereShape {
  Vec3 centre;
  double radius = 1.0;
  bool inward = false;  ///< the outer side is the inside
  int material = 0;
};

/// radius(s) = base_radius + slope s for s in [0, height] along `axis`; a cylinder has slope 0.
struct ConeShape {
  Vec3 base;
  Vec3 axis;  ///< unit, from base to apex
  double height = 1.0;
  double base_radius = 1.0;
  double slope = 0.0;
  bool inward = false;
  int material = 0;
};

/// Where a line meets a surface: `count` parameters, ascending.
struct Roots {
  int count = 0;
  double t[2] = {0.0, 0.0};
};

/// Real roots of a t^2 + 2 half_b t + c, without the cancellation of the textbook formula; a may be
/// zero. A double root counts twice.
[[nodiscard]] Roots quadratic_roots(double a, double half_b, double c);

/// `direction` need not have unit length.
[[nodiscard]] Roots meet(const SphereShape& sphere, Vec3 origin, Vec3 direction);
[[nodiscard]] Roots meet(const ConeShape& cone, Vec3 origin, Vec3 direction);

/// The first root in (t_min, t_max), or t_max where there is none.
[[nodiscard]] inline double first_root(const Roots& roots, double t_min, double t_max) {
  for (int i = 0; i < roots.count; ++i)
    if (roots.t[i] > t_min && roots.t[i] < t_max) return roots.t[i];
  return t_max;
}

/// The nearest point of the surface to one that is almost on it.
[[nodiscard]] Vec3 project_onto(const SphereShape& sphere, Vec3 point);
[[nodiscard]] Vec3 project_onto(const ConeShape& cone, Vec3 point);

/// Unit normal at a point of the surface, on its outer side; zero at the tip of a cone.
[[nodiscard]] Vec3 outer_normal(const SphereShape& sphere, Vec3 point);
[[nodiscard]] Vec3 outer_normal(const ConeShape& cone, Vec3 point);

/// Half the size of the box around a disc, along each axis.
[[nodiscard]] Vec3 disc_extent(Vec3 unit_normal, double radius);

struct Box {
  Vec3 low;
  Vec3 high;
};
[[nodiscard]] Box box_of(const SphereShape& sphere);
[[nodiscard]] Box box_of(const ConeShape& cone);

}  // namespace lenticule::render
