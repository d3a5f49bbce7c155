// SPDX-License-Identifier: Apache-2.0
// Materials imports glTF's materials with their textures. Notes counts what a loader leaves out,
// and reports each kind of thing in one line.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "render/loaders/gltf/document.h"
#include "render/loaders/textures.h"
#include "render/scene/scene_description.h"

namespace lenticule::render::gltf {

class Notes {
 public:
  /// `items` follows the number in the note: "primitives of points or lines left out".
  void count(const std::string& items, size_t number = 1) {
    if (number == 0) return;
    const auto known = std::ranges::find(counts_, items, &Count::first);
    if (known != counts_.end())
      known->second += number;
    else
      counts_.emplace_back(items, number);
  }

  void write(SceneDescription& scene) const {
    for (const auto& [items, number] : counts_)
      scene.notes.push_back(fmt::format("{} {}", number, items));
  }

 private:
  using Count = std::pair<std::string, size_t>;
  std::vector<Count> counts_;
};

/// MaterialInput lists what a material needs of the vertices of its meshes.
struct MaterialInput {
  /// Sets of texture coordinates (TEXCOORD_n), in the order of use: the first becomes
  /// TriangleMesh::uvs, the second TriangleMesh::uvs2.
  std::vector<uint64_t> uv_sets{};
  /// Position in uv_sets of the coordinates that orient the tangents, if there are any.
  std::optional<size_t> tangent_uvs{};
};

class Materials {
 public:
  /// Imports all materials; only the names of those that are not used. Lifetime: must not outlive
  /// document, scene and notes.
  Materials(Document& document, const std::vector<bool>& used, SceneDescription& scene,
            Notes& notes);
  Materials(const Materials&) = delete;
  Materials& operator=(const Materials&) = delete;

  /// Returns the index in the scene's materials of materials[index], or of the default material.
  [[nodiscard]] int index(std::optional<size_t> index);
  [[nodiscard]] const MaterialInput& input(int material) const {
    return inputs_[static_cast<size_t>(material)];
  }
  /// Returns the material for a mesh that its node magnifies: the thickness of volumes is in the
  /// mesh's units.
  [[nodiscard]] int magnified(int material, double scale);

 private:
  Materials(Document& document, const std::vector<bool>& used, SceneDescription& scene,
            Notes& notes, Textures::Mode mode);

  void add_all();
  void add(const std::optional<JsonAt>& material);
  /// Reads a texture of the last material.
  [[nodiscard]] TextureUse texture(const JsonAt& owner, const char* key,
                                   frames::TextureContent content);
  [[nodiscard]] int picture(const JsonAt& texture, frames::TextureContent content);
  void read_core(const JsonAt& from, PbrMaterial& to);
  void read_specular_glossiness(const JsonAt& from, PbrMaterial& to);
  void read_layers(const JsonAt& from, PbrMaterial& to);
  void read_transmission(const JsonAt& from, PbrMaterial& to);

  Document& document_;
  const std::vector<bool> used_;
  SceneDescription& scene_;
  Notes& notes_;
  Textures textures_;
  std::vector<MaterialInput> inputs_;
  std::optional<int> default_;
  bool requires_specular_glossiness_ = false;
  std::map<std::pair<int, double>, int> magnified_;
};

}  // namespace lenticule::render::gltf
