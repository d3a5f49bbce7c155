// SPDX-License-Identifier: Apache-2.0
// EnvironmentLight is the light that surrounds a model, filtered for matt and for rough surfaces
// (split sum: Karis, "Real Shading in Unreal Engine 4", 2013).
#pragma once

#include <functional>
#include <vector>

#include "optics/vec.h"
#include "render/shading/pbr_kernel.h"

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
  /// Returns the light that a smooth mirror shows.
  [[nodiscard]] Vec3 source(Vec3 direction) const;

  /// Returns the maps as render/shading/pbr_kernel.h reads them; the caller sets the axes.
  [[nodiscard]] pbr_kernel::Environment tables() const;

 private:
  /// Map holds all directions in a square: the octahedron, unfolded. Around it lies a border of one
  /// texel that repeats those across the edge.
  struct Map {
    int size = 0;
    std::vector<Vec3f> texels{};  ///< one more, since kernels read four numbers of each

    explicit Map(int side);
    /// Makes a map of value(x, y), called from several threads.
    template <class Value>
    Map(int side, const Value& value);
    [[nodiscard]] size_t index(int x, int y) const {
      return static_cast<size_t>((y + 1) * (size + 2) + x + 1);
    }
    [[nodiscard]] Vec3f& texel(int x, int y) { return texels[index(x, y)]; }
    [[nodiscard]] const Vec3f& texel(int x, int y) const { return texels[index(x, y)]; }
    /// Interpolates at a place in the square; both coordinates are between 0 and 1.
    [[nodiscard]] Vec3 at(Vec2 place) const;
    [[nodiscard]] Map halved() const;
    void set_border();
  };
  /// Roughness increases by the same amount from map to map; the first map is the source itself.
  static constexpr int kMaps = pbr_kernel::Environment::kMaps + 1;

  [[nodiscard]] static Map filtered(const std::vector<Map>& light, double roughness);
  [[nodiscard]] static Map cosine_filtered(const Map& light);

  Source source_{};  ///< empty if the light is uniform
  Vec3 uniform_{};
  std::vector<Map> maps_{};
  Map diffuse_{0};
};

}  // namespace lenticule::render
