// SPDX-License-Identifier: Apache-2.0
// Primitives imports the triangles of glTF's meshes.
#pragma once

#include <map>
#include <vector>

#include "render/loaders/gltf/document.h"
#include "render/loaders/gltf/materials.h"
#include "render/loaders/mesh_cleanup.h"

namespace lenticule::render::gltf {

/// MeshBudget limits the vertices and triangles of a scene before memory is allocated for them.
class MeshBudget {
 public:
  /// Throws Error(Input) through `where` if the total exceeds a limit.
  void take(size_t vertices, size_t triangles, const JsonAt& where);

 private:
  size_t vertices_ = 0;
  size_t triangles_ = 0;
};

/// Lifetime: must not outlive document, materials and notes.
class Primitives {
 public:
  Primitives(Document& document, Materials& materials, Notes& notes)
      : document_(document), materials_(materials), notes_(notes) {}

  /// Returns the primitives of meshes[index] that have triangles, in the mesh's coordinates. A
  /// deformation has no skin yet.
  [[nodiscard]] const std::vector<TriangleMesh>& of_mesh(size_t index);
  /// Returns the number of morph targets of meshes[index].
  [[nodiscard]] size_t targets(size_t index);
  /// Notes repaired triangles and normals, and meshes whose coordinates are coarse.
  void note_repairs(SceneDescription& scene) const;

 private:
  [[nodiscard]] TriangleMesh read(const JsonAt& primitive, const std::string& name);

  Document& document_;
  Materials& materials_;
  Notes& notes_;
  std::map<size_t, std::vector<TriangleMesh>> meshes_;
  MeshBudget budget_;
  MeshRepairs repairs_;
  LostDigits digits_;
};

}  // namespace lenticule::render::gltf
