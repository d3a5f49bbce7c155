// SPDX-License-Identifier: Apache-2.0
#include "render/scene/surface_groups.h"

#include <algorithm>
#include <array>
#include <bit>
#include <numeric>
#include <utility>

namespace lenticule::render {
namespace {

/// Cosine between the normals of two faces above which they count as coplanar (a thousandth of a
/// degree).
constexpr double kSamePlane = 1.0 - 1.5e-10;
/// Cosine between shading normals that count as equal on metallic-roughness surfaces (a fifth of a
/// degree): exporters split vertices and round their normals apart.
constexpr double kSameNormal = 1.0 - 6e-6;

/// Joined is a union-find structure of triangles.
class Joined {
 public:
  explicit Joined(size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), uint32_t{0});
  }
  uint32_t root(uint32_t n) {
    while (parent_[n] != n) n = parent_[n] = parent_[parent_[n]];
    return n;
  }
  void join(uint32_t a, uint32_t b) { parent_[root(a)] = root(b); }

 private:
  std::vector<uint32_t> parent_;
};

using VertexBits = std::array<uint32_t, 6>;

VertexBits bits_of(const MeshShape& mesh, size_t vertex) {
  const auto bits = [](float v) { return std::bit_cast<uint32_t>(v + 0.0F); };  // -0 becomes +0
  const Vec3f& p = mesh.positions[vertex];
  if (mesh.normals.empty()) return {bits(p.x), bits(p.y), bits(p.z), 0, 0, 0};
  const Vec3f& n = mesh.normals[vertex];
  return {bits(p.x), bits(p.y), bits(p.z), bits(n.x), bits(n.y), bits(n.z)};
}

/// Gives equal vertices one number, since files often repeat vertices.
std::vector<uint32_t> welded(const MeshShape& mesh) {
  const size_t count = mesh.positions.size() - 1;
  std::vector<std::pair<VertexBits, uint32_t>> vertices(count);
  for (size_t n = 0; n < count; ++n) vertices[n] = {bits_of(mesh, n), static_cast<uint32_t>(n)};
  std::sort(vertices.begin(), vertices.end());
  std::vector<uint32_t> number(count);
  for (size_t n = 0; n < count; ++n) {
    const bool same = n > 0 && vertices[n].first == vertices[n - 1].first;
    number[vertices[n].second] = same ? number[vertices[n - 1].second] : vertices[n].second;
  }
  return number;
}

Vec3 face_normal(const MeshShape& mesh, uint32_t triangle) {
  const auto [a, b, c] = mesh.corners(triangle);
  return normalized(cross(Vec3(b) - Vec3(a), Vec3(c) - Vec3(a)));
}

struct Edge {
  uint64_t ends = 0;
  uint32_t triangle = 0;
  friend bool operator<(const Edge& a, const Edge& b) { return a.ends < b.ends; }
};

std::vector<Edge> edges_of(const MeshShape& mesh) {
  const std::vector<uint32_t> number = welded(mesh);
  std::vector<Edge> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t)
    for (size_t n = 0; n < 3; ++n) {
      const uint64_t a = number[mesh.triangles[t][n]], b = number[mesh.triangles[t][(n + 1) % 3]];
      edges.push_back({std::min(a, b) << 32 | std::max(a, b), t});
    }
  std::sort(edges.begin(), edges.end());
  return edges;
}

Joined join_triangles(const MeshShape& mesh) {
  Joined joined(mesh.triangles.size());
  const std::vector<Edge> edges = edges_of(mesh);
  for (size_t n = 1; n < edges.size(); ++n) {
    const Edge &a = edges[n - 1], &b = edges[n];
    if (a.ends != b.ends) continue;
    if (mesh.normals.empty() &&
        !(dot(face_normal(mesh, a.triangle), face_normal(mesh, b.triangle)) > kSamePlane))
      continue;
    joined.join(a.triangle, b.triangle);
  }
  return joined;
}

/// Gives vertices at one position one number, below that of the mesh's last vertex.
std::vector<uint32_t> welded_positions(const MeshShape& mesh) {
  constexpr uint32_t kFree = ~0U;
  const size_t count = mesh.positions.size() - 1;
  std::vector<uint32_t> table(std::bit_ceil(2 * count + 1), kFree);
  std::vector<uint32_t> number(count);
  const auto bits = [](float v) { return std::bit_cast<uint32_t>(v + 0.0F); };  // -0 becomes +0
  for (uint32_t n = 0; n < count; ++n) {
    const Vec3f& p = mesh.positions[n];
    uint32_t hash = bits(p.x) * 0x9e3779b9U ^ bits(p.y) * 0x85ebca6bU ^ bits(p.z) * 0xc2b2ae35U;
    hash = (hash ^ hash >> 15) * 0x2c1b3c6dU;
    size_t at = (hash ^ hash >> 13) & (table.size() - 1);
    for (; table[at] != kFree; at = (at + 1) & (table.size() - 1)) {
      const Vec3f& q = mesh.positions[table[at]];
      if (p.x == q.x && p.y == q.y && p.z == q.z) break;
    }
    if (table[at] == kFree) table[at] = n;
    number[n] = table[at];
  }
  return number;
}

/// Edge of a triangle in a list by the number of its lower end.
struct HalfEdge {
  uint32_t high_number;
  uint32_t triangle;
  uint32_t low, high;  ///< vertices
};

/// Joins the triangles of a mesh of a metallic-roughness material. More than two may share an edge,
/// as where both sides of a sheet are modelled.
Joined join_pbr_triangles(const MeshShape& mesh) {
  const std::vector<uint32_t> number = welded_positions(mesh);
  const auto each_edge = [&](const auto& use) {
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t)
      for (size_t n = 0; n < 3; ++n) {
        uint32_t low = mesh.triangles[t][n], high = mesh.triangles[t][(n + 1) % 3];
        if (number[low] > number[high]) std::swap(low, high);
        use(number[low], HalfEdge{number[high], t, low, high});
      }
  };
  std::vector<uint32_t> end(number.size() + 1, 0);
  each_edge([&](uint32_t low, const HalfEdge&) { ++end[low + 1]; });
  for (size_t n = 1; n < end.size(); ++n) end[n] += end[n - 1];
  std::vector<HalfEdge> edges(3 * mesh.triangles.size());
  std::vector<uint32_t> next(end.begin(), end.end() - 1);
  each_edge([&](uint32_t low, const HalfEdge& edge) { edges[next[low]++] = edge; });
  const auto same = [&](uint32_t m, uint32_t n) {
    if (m == n) return true;
    const Vec3 a(mesh.normals[m]), b(mesh.normals[n]);
    return dot(a, b) >= kSameNormal * length(a) * length(b);
  };
  constexpr uint32_t kMostCompared = 64;
  Joined joined(mesh.triangles.size());
  for (size_t v = 0; v + 1 < end.size(); ++v)
    for (uint32_t n = end[v]; n < end[v + 1]; ++n)
      for (uint32_t m = n; m > end[v] && n - m < kMostCompared; --m) {
        const HalfEdge &a = edges[m - 1], &b = edges[n];
        if (a.high_number == b.high_number && same(a.low, b.low) && same(a.high, b.high))
          joined.join(a.triangle, b.triangle);
      }
  return joined;
}

uint32_t group_number(const Scene& scene, int material, uint32_t count) {
  const Material& m = scene.materials[static_cast<size_t>(material)];
  using enum PbrMaterial::AlphaMode;
  const bool glass =
      m.pbr ? m.pbr->transmission > 0.0 || m.pbr->alpha_mode != Opaque : m.transmittance > 0.0;
  const bool view = m.pbr ? !m.pbr->unlit || glass : m.specular > 0.0 || glass;
  return (count + 1) << 2 | (glass ? 2U : 0U) | (view ? 1U : 0U);
}

}  // namespace

SurfaceGroups::SurfaceGroups(const Scene& scene) {
  for (const GeometryEntry& entry : scene.geometries) {
    first_.push_back(groups_.size());
    if (entry.kind == GeometryEntry::Kind::Mesh) add_mesh(scene, scene.meshes[entry.mesh]);
    if (entry.kind == GeometryEntry::Kind::Spheres)
      for (const SphereShape& sphere : scene.spheres) add(scene, sphere.material);
    if (entry.kind == GeometryEntry::Kind::Cones)
      for (const ConeShape& cone : scene.cones) add(scene, cone.material);
  }
}

void SurfaceGroups::add(const Scene& scene, int material) {
  groups_.push_back(group_number(scene, material, count_++));
}

void SurfaceGroups::add_mesh(const Scene& scene, const MeshShape& mesh) {
  const bool is_pbr = scene.materials[static_cast<size_t>(mesh.material)].pbr != nullptr;
  Joined joined = is_pbr && !mesh.normals.empty() ? join_pbr_triangles(mesh) : join_triangles(mesh);
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t)
    groups_.push_back(group_number(scene, mesh.material, count_ + joined.root(t)));
  count_ += static_cast<uint32_t>(mesh.triangles.size());
}

}  // namespace lenticule::render
