// SPDX-License-Identifier: Apache-2.0
// Nodes imports glTF's node hierarchy with what hangs on it: meshes, skins, cameras and lights.
#pragma once

#include <optional>
#include <vector>

#include "render/loaders/gltf/primitives.h"

namespace lenticule::render::gltf {

/// Lifetime: must not outlive document, scene, materials and notes.
class Nodes {
 public:
  /// Imports the hierarchy, parents first. Throws Error(Input) for a node with two parents and for
  /// one that is its own ancestor.
  Nodes(Document& document, SceneDescription& scene, Notes& notes);

  /// Returns the index in the scene of nodes[index].
  [[nodiscard]] int index(size_t index) const { return places_[index]; }

  void import_skins();
  void import_meshes(Materials& materials);
  void import_lights();
  /// Requires the meshes to be in place: a file states the direction in which a camera looks, but
  /// not the distance.
  void import_cameras();

 private:
  void import_hierarchy();
  void mark_shown();
  /// Adds the meshes to the scene, once per instance.
  void show(size_t node, const std::vector<TriangleMesh>& meshes);
  [[nodiscard]] std::vector<int> instances(const JsonAt& node, int place);
  [[nodiscard]] std::shared_ptr<const Deformation> with_skin(
      const std::shared_ptr<const Deformation>& deformation, const JsonAt& node,
      const std::string& mesh) const;

  Document& document_;
  SceneDescription& scene_;
  Notes& notes_;
  const std::vector<JsonAt>& nodes_;
  std::vector<int> places_;    ///< indices in the scene
  std::vector<bool> shown_;    ///< the node belongs to the scene that is shown
  std::vector<size_t> order_;  ///< parents first
  MeshBudget budget_;
};

}  // namespace lenticule::render::gltf
