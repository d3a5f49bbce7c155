// SPDX-License-Identifier: Apache-2.0
// Writes NFF text, the format that every built-in scene is handed out in.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>

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

/// An f line.
struct Fill {
  Vec3 colour{1, 1, 1};
  double diffuse = 0.8;
  double specular = 0.0;
  double shine = 10.0;
  double transmittance = 0.0;
  double refraction_index = 1.0;
};

struct SurfacePoint {
  Vec3 position;
  Vec3 normal;
};
using SurfaceTriangle = std::array<SurfacePoint, 3>;

class NffWriter {
 public:
  /// Each line of `text` becomes a comment line.
  void comment(std::string_view text);
  void view(const View& view);
  void background(Vec3 colour);
  void light(Vec3 position, Vec3 colour = {1, 1, 1});
  void fill(const Fill& fill);
  void sphere(Vec3 centre, double radius);
  /// Open; a cylinder where both radii are equal.
  void cone(Vec3 base, double base_radius, Vec3 apex, double apex_radius);
  void polygon(std::span<const Vec3> corners);
  void patch(std::span<const SurfacePoint> corners);

  [[nodiscard]] std::string take() { return std::move(text_); }

 private:
  void vector(Vec3 v);

  std::string text_;
};

}  // namespace lenticule::scenes
