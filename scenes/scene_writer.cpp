// SPDX-License-Identifier: Apache-2.0
#include "scenes/scene_writer.h"

#include <array>
#include <utility>

#include "scenes/nff_writer.h"

namespace lenticule::scenes {
namespace {

double rounded(double number) {
  return as_read_from_nff(number);
}
Vec3 rounded(Vec3 v) {
  return {rounded(v.x), rounded(v.y), rounded(v.z)};
}

}  // namespace

std::string nff_text(const SceneParts& parts) {
  NffWriter out;
  for (const Element& element : parts.elements)
    std::visit([&](const auto& kind) { out.add(kind); }, element);
  for (const std::string& comment : parts.comments) out.comment(comment);
  return out.take();
}

void SceneWriter::view(const View& view) {
  parts_.elements.emplace_back(View{.from = rounded(view.from),
                                    .at = rounded(view.at),
                                    .up = rounded(view.up),
                                    .angle_degrees = rounded(view.angle_degrees),
                                    .hither = rounded(view.hither),
                                    .resolution = view.resolution});
}

void SceneWriter::background(Vec3 colour) {
  parts_.elements.emplace_back(Background{rounded(colour)});
}

void SceneWriter::light(Vec3 position, Vec3 colour) {
  parts_.elements.emplace_back(PointLight{rounded(position), rounded(colour)});
  ++parts_.counts.lights;
}

void SceneWriter::fill(const Fill& fill) {
  parts_.elements.emplace_back(Fill{.colour = rounded(fill.colour),
                                    .diffuse = rounded(fill.diffuse),
                                    .specular = rounded(fill.specular),
                                    .shine = rounded(fill.shine),
                                    .transmittance = rounded(fill.transmittance),
                                    .refraction_index = rounded(fill.refraction_index)});
}

void SceneWriter::sphere(Vec3 centre, double radius) {
  parts_.elements.emplace_back(Sphere{rounded(centre), rounded(radius)});
  ++parts_.counts.spheres;
}

void SceneWriter::cone(Vec3 base, double base_radius, Vec3 apex, double apex_radius) {
  parts_.elements.emplace_back(
      Cone{rounded(base), rounded(base_radius), rounded(apex), rounded(apex_radius)});
  ++parts_.counts.cones;
}

void SceneWriter::polygon(std::span<const Vec3> corners) {
  Polygon polygon;
  for (const Vec3 corner : corners) polygon.corners.push_back(rounded(corner));
  parts_.elements.emplace_back(std::move(polygon));
  ++parts_.counts.polygons;
}

void SceneWriter::patch(std::span<const SurfacePoint> corners) {
  Polygon polygon;
  for (const SurfacePoint& corner : corners) {
    polygon.corners.push_back(rounded(corner.position));
    polygon.normals.push_back(rounded(corner.normal));
  }
  parts_.elements.emplace_back(std::move(polygon));
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

namespace {

void write_squares(SceneWriter& out, const CheckerBoard& board, int parity) {
  // Corners are computed from the whole edge, so that neighbouring squares share them exactly.
  const auto point = [&](int column, int row) {
    return board.corner + board.along * (static_cast<double>(column) / board.columns) +
           board.across * (static_cast<double>(row) / board.rows);
  };
  for (int row = 0; row < board.rows; ++row)
    for (int column = (row + parity) % 2; column < board.columns; column += 2)
      out.polygon(std::array{point(column, row), point(column + 1, row), point(column + 1, row + 1),
                             point(column, row + 1)});
}

}  // namespace

void write_checker_board(SceneWriter& out, const CheckerBoard& board) {
  out.fill(board.even);
  write_squares(out, board, 0);
  out.fill(board.odd);
  write_squares(out, board, 1);
}

}  // namespace lenticule::scenes
