// SPDX-License-Identifier: Apache-2.0
// NffWriter writes NFF text, the format in which all built-in scenes are output.
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

/// Fill holds the values of an f line.
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
  /// Writes each line of `text` as a comment line.
  void comment(std::string_view text);
  void view(const View& view);
  void background(Vec3 colour);
  void light(Vec3 position, Vec3 colour = {1, 1, 1});
  void fill(const Fill& fill);
  void sphere(Vec3 centre, double radius);
  /// Writes an open cone; a cylinder if both radii are equal.
  void cone(Vec3 base, double base_radius, Vec3 apex, double apex_radius);
  void polygon(std::span<const Vec3> corners);
  void patch(std::span<const SurfacePoint> corners);

  [[nodiscard]] std::string take() { return std::move(text_); }

 private:
  void vector(Vec3 v);

  std::string text_;
};

}  // namespace lenticule::scenes
