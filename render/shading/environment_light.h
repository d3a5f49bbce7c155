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

/// EnvironmentLight holds latitude-longitude maps of one light. Directions are unit; x is to the
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
  /// Map is a latitude-longitude picture whose middle is the direction -z.
  struct Map {
    int width = 0;
    int height = 0;
    std::vector<Vec3f> texels{};

    [[nodiscard]] Vec3 direction(int x, int y) const;
    /// Interpolates at a place in the picture; both coordinates are between 0 and 1.
    [[nodiscard]] Vec3 at(Vec2 place) const;
    [[nodiscard]] Map halved() const;
  };
  /// Roughness increases by the same amount from map to map; the first map is the source itself.
  static constexpr int kMaps = 9;

  [[nodiscard]] static Map filtered(const std::vector<Map>& light, double roughness);
  [[nodiscard]] static Map cosine_filtered(const Map& light);

  Source source_{};  ///< empty if the light is uniform
  Vec3 uniform_{};
  std::vector<Map> maps_{};
  Map diffuse_{};
};

}  // namespace lenticule::render
