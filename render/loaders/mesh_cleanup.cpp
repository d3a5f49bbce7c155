// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/mesh_cleanup.h"

#include <algorithm>

namespace lenticule::render {
namespace {

using Triangle = std::array<uint32_t, 3>;

/// Returns twice the area times the unit normal.
Vec3 area_vector(const TriangleMesh& mesh, const Triangle& t) {
  const Vec3 a = mesh.positions[t[0]];
  return cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a);
}

bool has_area(const TriangleMesh& mesh, const Triangle& t) {
  constexpr double kThinnest = 1e-14;
  const Vec3 a = mesh.positions[t[0]];
  const Vec3 b = mesh.positions[t[1]];
  const Vec3 c = mesh.positions[t[2]];
  const double longest = std::max({dot(b - a, b - a), dot(c - b, c - b), dot(a - c, a - c)});
  return length(area_vector(mesh, t)) > kThinnest * longest;
}

/// Returns the area-weighted mean normals of the faces around each vertex.
std::vector<Vec3> face_means(const TriangleMesh& mesh) {
  std::vector<Vec3> sums(mesh.positions.size());
  for (const Triangle& t : mesh.triangles)
    for (const uint32_t corner : t) sums[corner] += area_vector(mesh, t);
  return sums;
}

bool is_unit(Vec3 v) {
  return std::abs(dot(v, v) - 1.0) < 1e-6;
}

}  // namespace

MeshRepairs clean(TriangleMesh& mesh) {
  MeshRepairs repairs;
  repairs.dropped_triangles =
      std::erase_if(mesh.triangles, [&](const Triangle& t) { return !has_area(mesh, t); });
  std::vector<Vec3> means;
  for (size_t i = 0; i < mesh.normals.size(); ++i) {
    Vec3& normal = mesh.normals[i];
    normal = normalized(normal);
    if (is_unit(normal)) continue;
    if (means.empty()) means = face_means(mesh);
    normal = normalized(means[i]);
    // A vertex without faces, or with faces that cancel: any direction is valid.
    if (!is_unit(normal)) normal = {0, 0, 1};
    ++repairs.recomputed_normals;
  }
  return repairs;
}

}  // namespace lenticule::render
