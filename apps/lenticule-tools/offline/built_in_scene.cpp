// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/built_in_scene.h"

#include <map>
#include <string>
#include <utility>
#include <variant>

#include "base/error.h"
#include "render/loaders/nff.h"

namespace lenticule::tools {
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

render::Material material_of(const scenes::Fill& fill) {
  return {.colour = fill.colour,
          .diffuse = fill.diffuse,
          .specular = fill.specular,
          .shine = fill.shine,
          .transmittance = fill.transmittance,
          .refraction_index = fill.refraction_index};
}

/// ElementAdder adds the elements of a scene to its description.
class ElementAdder {
 public:
  explicit ElementAdder(render::NffScene& scene) : scene_(scene) {}

  void operator()(const scenes::View& view) {
    scene_.view({.name = "view",
                 .from = view.from,
                 .at = view.at,
                 .up = view.up,
                 .vertical_fov_degrees = view.angle_degrees,
                 .hither = view.hither});
  }
  void operator()(const scenes::Background& background) { scene_.background(background.colour); }
  void operator()(const scenes::PointLight& light) { scene_.light(light.position, light.colour); }
  void operator()(const scenes::Fill& fill) { scene_.fill(material_of(fill)); }
  void operator()(const scenes::Sphere& sphere) { scene_.sphere(sphere.centre, sphere.radius); }
  void operator()(const scenes::Cone& cone) {
    scene_.cone(cone.base, cone.base_radius, cone.apex, cone.apex_radius);
  }
  void operator()(const scenes::Polygon& polygon) {
    LENTICULE_CHECK(scene_.polygon(polygon.corners, polygon.normals));
  }

 private:
  render::NffScene& scene_;
};

/// PictureHanger adds the textured meshes of a scene to its description.
class PictureHanger {
 public:
  explicit PictureHanger(render::SceneDescription& scene) : scene_(scene) {}

  void hang(scenes::PicturedMesh mesh) {
    render::Material& material = scene_.materials.emplace_back(material_of(mesh.fill));
    material.name = mesh.picture->name;
    material.texture = texture(*mesh.picture);
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
  render::NffScene elements(std::string("builtin:") + scene.name);
  for (const scenes::Element& element : parts.elements) std::visit(ElementAdder(elements), element);
  render::SceneDescription description = elements.finish();
  PictureHanger hanger(description);
  for (scenes::PicturedMesh& mesh : parts.pictured) hanger.hang(std::move(mesh));
  return description;
}

}  // namespace lenticule::tools
