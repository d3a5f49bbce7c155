// SPDX-License-Identifier: Apache-2.0
// EnvironmentLight is the light that surrounds a model, filtered for matt and for rough surfaces
// (split sum: Karis, "Real Shading in Unreal Engine 4", 2013).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "optics/vec.h"

namespace lenticule::render {

/// EnvironmentLight holds maps of one light. Directions are unit; x is to the
/// right of the viewer, y up, and z points to the viewer. Thread safety: immutable.
class EnvironmentLight {
 public:
  /// Returns the mean of the light that comes from a direction and from within an angle (radians)
  /// around the direction.
  using Source = std::function<Vec3(Vec3 direction, double angle)>;

  /// Filters `source`, which is called from several threads.
  explicit EnvironmentLight(Source source);
  /// Light that is equal in all directions.
  explicit EnvironmentLight(Vec3 uniform);

  /// Returns the mean of the light around the mirror direction `direction`, weighted by the GGX
  /// lobe of a surface of this roughness that is seen from straight ahead.
  [[nodiscard]] Vec3 mirrored(Vec3 direction, double roughness) const;
  /// Returns the mean of the light over the hemisphere around `normal`, weighted by the cosine: the
  /// light of a white matt surface.
  [[nodiscard]] Vec3 diffuse(Vec3 normal) const;

 private:
  /// Map holds all directions in a square: the octahedron, unfolded. Around it lies a border of one
  /// texel that repeats those across the edge.
  struct Map {
    int size = 0;
    std::vector<Vec3f> texels{};

    explicit Map(int side);
    [[nodiscard]] Vec3f& texel(int x, int y) {
      return texels[static_cast<size_t>((y + 1) * (size + 2) + x + 1)];
    }
    [[nodiscard]] const Vec3f& texel(int x, int y) const {
      return texels[static_cast<size_t>((y + 1) * (size + 2) + x + 1)];
    }
    /// Interpolates at a place in the square; both coordinates are between 0 and 1.
    [[nodiscard]] Vec3 at(Vec2 place) const;
    [[nodiscard]] Map halved() const;
    void set_border();
  };
  /// Roughness increases by the same amount from map to map; the first map is the source itself.
  static constexpr int kMaps = 9;

  [[nodiscard]] static Map filtered(const std::vector<Map>& light, double roughness);
  [[nodiscard]] static Map cosine_filtered(const Map& light);

  Source source_{};  ///< empty if the light is uniform
  Vec3 uniform_{};
  std::vector<Map> maps_{};
  Map diffuse_{0};
};

}  // namespace lenticule::render
