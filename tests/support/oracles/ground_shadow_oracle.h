// SPDX-License-Identifier: Apache-2.0
// Reference implementation of the ground shadow: the formula of docs/render/shading.md as it stands
// there, in double precision and world coordinates, point by point. It shares no code with render/
// beyond the description of scenes.
#pragma once

#include <vector>

#include "render/scene/scene_description.h"

namespace lenticule::test {

/// OracleGroundShadow handles scenes of meshes without textures.
class OracleGroundShadow {
 public:
  /// `centre` is the world point at the origin of the scene frame.
  OracleGroundShadow(const render::SceneDescription& scene, Vec3 centre);

  /// Returns the share of the background's light that a ray in world coordinates sees.
  [[nodiscard]] double light_left(Vec3 origin, Vec3 direction) const;

 private:
  [[nodiscard]] double darkness(int i, int j) const;
  [[nodiscard]] double hidden(const render::SceneDescription& scene, double x, double z,
                              double highest) const;

  Vec3 centre_, low_, high_;
  double size_ = 0.0, cell_ = 0.0;
  int first_i_ = 0, first_j_ = 0, columns_ = 0, rows_ = 0;
  std::vector<double> hidden_[2];  ///< hidden share of the sky at each grid point, by layer
};

}  // namespace lenticule::test
