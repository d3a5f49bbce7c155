// SPDX-License-Identifier: Apache-2.0
// PLY after G. Turk, "The PLY Polygon File Format" (1994): a header in text declares elements with
// properties, and the values follow in that order. Also reads what programs added since: triangle
// strips (Stanford: a list that -1 divides into strips), and the texture coordinates of faces and
// "comment TextureFile" of MeshLab.
#include "render/loaders/ply.h"

#include <fmt/format.h>

#include <memory>
#include <string_view>
#include <utility>

#include "base/file.h"
#include "render/loaders/file_names.h"
#include "render/loaders/limits.h"
#include "render/loaders/lost_digits.h"
#include "render/loaders/mesh_cleanup.h"
#include "render/loaders/ply/elements.h"
#include "render/loaders/ply/header.h"
#include "render/loaders/textures.h"
#include "render/scene/nothing_seen.h"

namespace lenticule::render {
namespace {

/// Returns the scene of the elements; its texture lies in `folder`.
SceneDescription scene_of(ply::Elements elements, const std::string& texture,
                          const std::string& source, const std::filesystem::path& folder) {
  TriangleMesh& mesh = elements.mesh;
  SceneDescription scene;
  scene.source = source;
  const auto note = [&](size_t count, const char* items) {
    if (count > 0) scene.notes.push_back(fmt::format("{} {}", count, items));
  };
  if (mesh.triangles.empty()) {
    note(mesh.positions.size(), "points without faces left out");
    refuse_empty(scene);
  }
  Material material;
  material.name = "surface";
  material.colour = {0.6, 0.6, 0.6};
  material.specular = 0.06;
  material.shine = 10.0;
  if (!texture.empty())
    material.texture = Textures(scene).add(
        {.name = texture}, [&] { return frames::read_texture(named_file(folder, texture)); });
  if (material.texture >= 0) material.colour = {1, 1, 1};
  if (!mesh.colours.empty()) {
    PbrMaterial pbr;
    pbr.metallic = 0.0;
    pbr.double_sided = true;
    pbr.base_colour_texture.texture = material.texture;
    material.pbr = std::make_shared<const PbrMaterial>(pbr);
  }
  scene.materials.push_back(material);
  LostDigits digits;
  if (elements.single_precision) digits.add(mesh);
  const MeshRepairs repairs = clean(mesh);
  note(repairs.dropped_triangles, "triangles without an area dropped");
  if (mesh.triangles.empty()) refuse_empty(scene);
  note(repairs.recomputed_normals, "unusable normals recomputed");
  note(elements.ignored, "elements other than faces and triangle strips left out");
  if (elements.face_colours) scene.notes.emplace_back("colours of faces left out");
  digits.write(scene);
  scene.meshes.push_back(std::move(mesh));
  return scene;
}

}  // namespace

SceneDescription parse_ply(std::span<const uint8_t> bytes, const std::string& source,
                           const std::filesystem::path& folder) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const ply::Header header = ply::read_header(text, source);
  return scene_of(ply::read_elements(header, text, source), header.texture, source, folder);
}

SceneDescription load_ply(const std::filesystem::path& file) {
  return parse_ply(read_whole_file(file, kMaxSceneFileBytes), file.string(), file.parent_path());
}

}  // namespace lenticule::render
