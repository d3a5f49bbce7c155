// SPDX-License-Identifier: Apache-2.0
// LostDigits finds meshes so far from the origin that the single precision of their file shows.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::render {

class LostDigits {
 public:
  /// Examines a mesh whose positions come from single precision, in the file's coordinates.
  void add(const TriangleMesh& mesh);
  /// Adds a note about the coarsest mesh, if any is coarse.
  void write(SceneDescription& scene) const;

 private:
  size_t meshes_ = 0;
  double coarsest_ = 0.0;  ///< step of the coordinates, in sizes of the mesh
  double step_ = 0.0;      ///< that step in units of the file
};

}  // namespace lenticule::render
