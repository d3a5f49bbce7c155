// SPDX-License-Identifier: Apache-2.0
// Elements of a built-in scene: one for each kind of line of the Neutral File Format.
#pragma once

#include <array>
#include <variant>
#include <vector>

#include "optics/vec.h"

namespace lenticule::scenes {

struct View {
  Vec3 from;
  Vec3 at;
  Vec3 up{0, 0, 1};
  double angle_degrees = 45.0;  ///< full vertical field of view
  double hither = 0.01;
  int resolution = 512;
};

struct Background {
  Vec3 colour;
};

struct PointLight {
  Vec3 position;
  Vec3 colour{1, 1, 1};
};

/// Fill is the material of the surfaces that follow it.
struct Fill {
  Vec3 colour{1, 1, 1};
  double diffuse = 0.8;
  double specular = 0.0;
  double shine = 10.0;
  double transmittance = 0.0;
  double refraction_index = 1.0;
};

struct Sphere {
  Vec3 centre;
  double radius = 1.0;  ///< negative if the inside is visible
};

/// Cone is open; a cylinder if both radii are equal. Negative radii make the inside visible.
struct Cone {
  Vec3 base;
  double base_radius = 1.0;
  Vec3 apex;
  double apex_radius = 0.0;
};

struct Polygon {
  std::vector<Vec3> corners;
  std::vector<Vec3> normals{};  ///< per corner; empty for flat shading
};

using Element = std::variant<View, Background, PointLight, Fill, Sphere, Cone, Polygon>;

struct SurfacePoint {
  Vec3 position;
  Vec3 normal;
};
using SurfaceTriangle = std::array<SurfacePoint, 3>;

}  // namespace lenticule::scenes
