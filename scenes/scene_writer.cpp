// SPDX-License-Identifier: Apache-2.0
#include "scenes/scene_writer.h"

#include <utility>

namespace lenticule::scenes {

void SceneWriter::light(Vec3 position, Vec3 colour) {
  text_.light(position, colour);
  ++parts_.counts.lights;
}

void SceneWriter::sphere(Vec3 centre, double radius) {
  text_.sphere(centre, radius);
  ++parts_.counts.spheres;
}

void SceneWriter::cone(Vec3 base, double base_radius, Vec3 apex, double apex_radius) {
  text_.cone(base, base_radius, apex, apex_radius);
  ++parts_.counts.cones;
}

void SceneWriter::polygon(std::span<const Vec3> corners) {
  text_.polygon(corners);
  ++parts_.counts.polygons;
}

void SceneWriter::patch(std::span<const SurfacePoint> corners) {
  text_.patch(corners);
  ++parts_.counts.polygons;
}

void SceneWriter::pictured(PicturedMesh mesh) {
  if (pictures_ == Pictures::Plain) return write_plain(mesh);
  parts_.counts.polygons += static_cast<int>(mesh.triangles.size());
  parts_.pictured.push_back(std::move(mesh));
}

void SceneWriter::write_plain(const PicturedMesh& mesh) {
  if (!said_plain_)
    comment("NFF has no pictures: surfaces that wear one have its mean colour here");
  said_plain_ = true;
  Fill plain = mesh.fill;
  plain.colour = plain.colour * mesh.picture->mean();
  fill(plain);
  for (const auto& [a, b, c] : mesh.triangles) {
    const auto& p = mesh.positions;
    const auto& n = mesh.normals;
    if (n.empty())
      polygon(std::array{p[a], p[b], p[c]});
    else
      patch(
          std::array{SurfacePoint{p[a], n[a]}, SurfacePoint{p[b], n[b]}, SurfacePoint{p[c], n[c]}});
  }
}

SceneParts SceneWriter::take() {
  for (const std::string& comment : comments_) text_.comment(comment);
  parts_.nff = text_.take();
  return std::move(parts_);
}

}  // namespace lenticule::scenes
