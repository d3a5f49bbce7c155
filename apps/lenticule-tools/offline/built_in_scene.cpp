// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/built_in_scene.h"

#include <map>
#include <string>
#include <utility>

#include "render/loaders/nff.h"

namespace lenticule::player {
namespace {

/// Copies a picture; without colour management, its code values stay unchanged.
render::Texture texture_of(const scenes::Picture& picture) {
  render::Texture texture{.width = picture.width, .height = picture.height, .name = picture.name};
  texture.rgba.reserve(picture.rgb.size() / 3 * 4);
  for (size_t i = 0; i + 2 < picture.rgb.size(); i += 3)
    texture.rgba.insert(texture.rgba.end(),
                        {picture.rgb[i], picture.rgb[i + 1], picture.rgb[i + 2], 1.0F});
  return texture;
}

class PictureHanger {
 public:
  explicit PictureHanger(render::SceneDescription& scene) : scene_(scene) {}

  void hang(scenes::PicturedMesh mesh) {
    const auto& fill = mesh.fill;
    scene_.materials.push_back({.name = mesh.picture->name,
                                .colour = fill.colour,
                                .diffuse = fill.diffuse,
                                .specular = fill.specular,
                                .shine = fill.shine,
                                .transmittance = fill.transmittance,
                                .refraction_index = fill.refraction_index,
                                .texture = texture(*mesh.picture)});
    scene_.meshes.push_back({.name = mesh.picture->name,
                             .material = static_cast<int>(scene_.materials.size() - 1),
                             .positions = std::move(mesh.positions),
                             .triangles = std::move(mesh.triangles),
                             .normals = std::move(mesh.normals),
                             .uvs = std::move(mesh.uvs)});
  }

 private:
  int texture(const scenes::Picture& picture) {
    const auto [place, added] = index_.try_emplace(&picture, scene_.textures.size());
    if (added)
      scene_.textures.push_back(std::make_shared<const render::Texture>(texture_of(picture)));
    return static_cast<int>(place->second);
  }

  render::SceneDescription& scene_;
  std::map<const scenes::Picture*, size_t> index_;
};

}  // namespace

render::SceneDescription describe_built_in(const scenes::BuiltInScene& scene,
                                           std::optional<int> size, int frame) {
  scenes::SceneParts parts = scenes::build_scene(scene, size, frame);
  render::SceneDescription description =
      render::parse_nff(parts.nff, std::string("builtin:") + scene.name);
  PictureHanger hanger(description);
  for (scenes::PicturedMesh& mesh : parts.pictured) hanger.hang(std::move(mesh));
  return description;
}

}  // namespace lenticule::player
