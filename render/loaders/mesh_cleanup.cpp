// SPDX-License-Identifier: Apache-2.0
// Tangents as Mikkelsen's "Simulation of Wrinkled Surfaces Revisited" (2008) defines them and tools
// that make normal textures compute them: each face's derivative of the position by u, projected
// into the tangent plane of the vertex and normalised, weighted by the angle of the face at the
// vertex. Faces whose texture is mirrored do not mix with the others. Vertices of equal position,
// normal and coordinates count as one.
#include "render/loaders/mesh_cleanup.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <limits>
#include <numeric>
#include <tuple>

#include "frames/srgb.h"
#include "render/loaders/formats.h"
#include "render/scene/stage.h"

namespace lenticule::render {
namespace {

/// Returns twice the signed area of a triangle.
double turn(Vec2 a, Vec2 b, Vec2 c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// Projects along the axis in which the polygon appears largest. There is no rotation and so no
/// rounding: collinear corners stay collinear, and counter-clockwise outlines stay so.
Vec2 project(Vec3 p, Vec3 normal) {
  const Vec3 size{std::abs(normal.x), std::abs(normal.y), std::abs(normal.z)};
  if (size.x >= size.y && size.x >= size.z) return normal.x > 0 ? Vec2{p.y, p.z} : Vec2{p.z, p.y};
  if (size.y >= size.z) return normal.y > 0 ? Vec2{p.z, p.x} : Vec2{p.x, p.z};
  return normal.z > 0 ? Vec2{p.x, p.y} : Vec2{p.y, p.x};
}

/// Strictness states how much of the outline an ear may contain. A simple polygon needs only the
/// first level; the others ensure termination for outlines that touch or cross themselves.
enum class Strictness { NothingInside, NothingStrictlyInside, Anything };

class EarClipper {
 public:
  explicit EarClipper(std::vector<Vec2> points) : points_(std::move(points)) {
    const auto n = static_cast<uint32_t>(points_.size());
    queued_.assign(n, true);
    removed_.assign(n, false);
    for (uint32_t i = 0; i < n; ++i) {
      previous_.push_back(i == 0 ? n - 1 : i - 1);
      next_.push_back(i + 1 == n ? 0 : i + 1);
      candidates_.push_back(i);
    }
    std::ranges::copy_if(candidates_, std::back_inserter(concave_),
                         [this](uint32_t i) { return concave(i); });
  }

  Triangulation run() {
    for (size_t left = points_.size(); left > 3; --left) clip(next_ear());
    const uint32_t last = first_left_;
    if (turn_at(last) != 0.0) result_.triangles.push_back({previous_[last], last, next_[last]});
    return std::move(result_);
  }

 private:
  [[nodiscard]] double turn_at(uint32_t i) const {
    return turn(points_[previous_[i]], points_[i], points_[next_[i]]);
  }
  [[nodiscard]] bool concave(uint32_t i) const { return turn_at(i) <= 0.0; }

  /// Returns a corner that may be cut off, from the queue; the rules are relaxed if there is none.
  uint32_t next_ear() {
    while (true) {
      while (!candidates_.empty()) {
        const uint32_t i = candidates_.back();
        candidates_.pop_back();
        queued_[i] = false;
        if (!removed_[i] && is_ear(i)) return i;
      }
      if (strictness_ == Strictness::Anything) return first_left_;
      relax();
    }
  }

  void relax() {
    const bool first = strictness_ == Strictness::NothingInside;
    strictness_ = first ? Strictness::NothingStrictlyInside : Strictness::Anything;
    if (!first) result_.simple = false;
    uint32_t i = first_left_;
    do {
      push(i);
      i = next_[i];
    } while (i != first_left_);
  }

  bool is_ear(uint32_t i) {
    const double size = turn_at(i);
    if (size < 0.0) return false;
    // A straight corner has no area; it may be cut unless the outline turns back there.
    if (size == 0.0) return strictness_ != Strictness::NothingInside || !turns_back(i);
    if (strictness_ == Strictness::Anything) return true;
    const uint32_t a = previous_[i];
    const uint32_t c = next_[i];
    for (size_t k = 0; k < concave_.size();) {
      const uint32_t j = concave_[k];
      if (removed_[j] || !concave(j)) {  // corners only become convex: drop it
        concave_[k] = concave_.back();
        concave_.pop_back();
        continue;
      }
      if (j != a && j != c && j != i && blocks(points_[j], a, i, c)) return false;
      ++k;
    }
    return true;
  }

  [[nodiscard]] bool turns_back(uint32_t i) const {
    const Vec2 in = points_[i] - points_[previous_[i]];
    const Vec2 out = points_[next_[i]] - points_[i];
    return in.x * out.x + in.y * out.y < 0.0;
  }

  [[nodiscard]] bool blocks(Vec2 p, uint32_t a, uint32_t b, uint32_t c) const {
    const Vec2 pa = points_[a], pb = points_[b], pc = points_[c];
    if (p == pa || p == pb || p == pc) return false;
    const double ab = turn(pa, pb, p), bc = turn(pb, pc, p), ca = turn(pc, pa, p);
    if (strictness_ == Strictness::NothingInside) return ab >= 0 && bc >= 0 && ca >= 0;
    return ab > 0 && bc > 0 && ca > 0;
  }

  void clip(uint32_t i) {
    const uint32_t a = previous_[i];
    const uint32_t c = next_[i];
    if (turn_at(i) != 0.0) result_.triangles.push_back({a, i, c});
    next_[a] = c;
    previous_[c] = a;
    removed_[i] = true;
    if (first_left_ == i) first_left_ = c;
    push(a);
    push(c);
  }

  void push(uint32_t i) {
    if (queued_[i]) return;
    queued_[i] = true;
    candidates_.push_back(i);
  }

  std::vector<Vec2> points_;
  std::vector<uint32_t> previous_;
  std::vector<uint32_t> next_;
  std::vector<uint32_t> candidates_;
  std::vector<uint32_t> concave_;
  std::vector<bool> queued_;
  std::vector<bool> removed_;
  uint32_t first_left_ = 0;
  Strictness strictness_ = Strictness::NothingInside;
  Triangulation result_;
};

/// Returns the indices of the corners that differ from their predecessor.
std::vector<uint32_t> distinct_corners(std::span<const Vec3> corners) {
  std::vector<uint32_t> kept;
  for (size_t i = 0; i < corners.size(); ++i)
    if (kept.empty() || !(corners[i] == corners[kept.back()]))
      kept.push_back(static_cast<uint32_t>(i));
  while (kept.size() > 1 && corners[kept.back()] == corners[kept.front()]) kept.pop_back();
  return kept;
}

Box box_of(std::span<const Vec3> points) {
  Box box;
  for (const Vec3 p : points) box.extend(p);
  return box;
}

/// Returns true if the polygon is convex and winds once, so that a triangle fan covers it.
bool is_convex(const std::vector<Vec2>& points) {
  const size_t n = points.size();
  for (size_t i = 0; i < n; ++i)
    if (turn(points[i], points[(i + 1) % n], points[(i + 2) % n]) <= 0.0) return false;
  for (size_t i = 2; i + 1 < n; ++i)
    if (turn(points[0], points[i], points[i + 1]) <= 0.0) return false;
  return true;
}

Triangulation fan(size_t corners) {
  Triangulation result;
  for (uint32_t i = 1; i + 1 < corners; ++i) result.triangles.push_back({0, i, i + 1});
  return result;
}

using Triangle = std::array<uint32_t, 3>;

/// Returns twice the area times the unit normal.
Vec3 area_vector(const TriangleMesh& mesh, const Triangle& t) {
  const Vec3 a = mesh.positions[t[0]];
  return cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a);
}

bool has_area(const TriangleMesh& mesh, const Triangle& t) {
  constexpr double kThinnest = 1e-14;
  const Vec3 a = mesh.positions[t[0]], b = mesh.positions[t[1]], c = mesh.positions[t[2]];
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

using Uv = std::array<float, 2>;
using Uvs = std::vector<Uv>;

template <class T>
void select(std::vector<T>& values, const std::vector<uint32_t>& from, size_t per_vertex = 1) {
  if (values.empty()) return;
  std::vector<T> selected;
  selected.reserve(from.size() * per_vertex);
  for (const uint32_t i : from)
    for (size_t k = 0; k < per_vertex; ++k) selected.push_back(values[i * per_vertex + k]);
  values = std::move(selected);
}

/// Makes vertex i a copy of the old vertex from[i], with all its attributes. Does not change the
/// triangles.
void select_vertices(TriangleMesh& mesh, const std::vector<uint32_t>& from) {
  select(mesh.positions, from);
  select(mesh.normals, from);
  select(mesh.uvs, from);
  select(mesh.uvs2, from);
  select(mesh.colours, from);
  select(mesh.tangents, from);
  if (!mesh.deformation) return;
  auto deformation = std::make_shared<Deformation>(*mesh.deformation);
  select(deformation->joints, from, deformation->joints_per_vertex);
  select(deformation->weights, from, deformation->joints_per_vertex);
  for (MorphTarget& target : deformation->targets) {
    select(target.positions, from);
    select(target.normals, from);
    select(target.tangents, from);
  }
  mesh.deformation = std::move(deformation);
}

/// Gives every triangle its own vertices, with the normal of its face.
void make_flat(TriangleMesh& mesh) {
  split_vertices(mesh);
  mesh.normals.resize(mesh.positions.size());
  for (const Triangle& triangle : mesh.triangles) {
    const Vec3 normal = normalized(area_vector(mesh, triangle));
    for (const uint32_t corner : triangle) mesh.normals[corner] = normal;
  }
}

/// Returns for each vertex the first of the vertices that are equal to it.
std::vector<uint32_t> welded(const TriangleMesh& mesh, const Uvs& uvs) {
  const auto key = [&](uint32_t i) {
    const Vec3& p = mesh.positions[i];
    const Vec3& n = mesh.normals[i];
    return std::tuple(p.x, p.y, p.z, n.x, n.y, n.z, uvs[i][0], uvs[i][1]);
  };
  std::vector<uint32_t> order(mesh.positions.size());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::stable_sort(order, [&](uint32_t a, uint32_t b) { return key(a) < key(b); });
  std::vector<uint32_t> first(order.size());
  for (size_t i = 0; i < order.size(); ++i)
    first[order[i]] = i > 0 && key(order[i - 1]) == key(order[i]) ? first[order[i - 1]] : order[i];
  return first;
}

/// Orientation of the texture on a face; Degenerate where the coordinates span no area.
enum Orientation : uint8_t { Mirrored = 0, Plain = 1, Degenerate = 2 };

struct FaceTangent {
  Vec3 direction{};
  Orientation orientation = Degenerate;
};

FaceTangent face_tangent(const TriangleMesh& mesh, const Uvs& uvs,
                         const std::array<uint32_t, 3>& face) {
  const auto [a, b, c] = face;
  const Vec3 e1 = mesh.positions[b] - mesh.positions[a];
  const Vec3 e2 = mesh.positions[c] - mesh.positions[a];
  const double u1 = double{uvs[b][0]} - double{uvs[a][0]};
  const double v1 = double{uvs[b][1]} - double{uvs[a][1]};
  const double u2 = double{uvs[c][0]} - double{uvs[a][0]};
  const double v2 = double{uvs[c][1]} - double{uvs[a][1]};
  const double area = u1 * v2 - u2 * v1;
  if (area == 0.0) return {};
  const Vec3 along_u = (e1 * v2 - e2 * v1) / area;
  // v points down: on a plain face the area is negative.
  return {along_u, area < 0.0 ? Plain : Mirrored};
}

/// Returns the part of `v` in the plane with the unit normal `n`, as a unit vector or zero.
Vec3 in_plane(Vec3 v, Vec3 n) { return normalized(v - n * dot(n, v)); }

/// TangentSums holds the sums of each group of equal vertices, one per orientation.
class TangentSums {
 public:
  TangentSums(const TriangleMesh& mesh, const Uvs& uvs)
      : first_(welded(mesh, uvs)), sums_(mesh.positions.size()) {
    for (const auto& face : mesh.triangles) {
      const FaceTangent tangent = face_tangent(mesh, uvs, face);
      if (tangent.orientation == Degenerate) continue;
      for (size_t k = 0; k < 3; ++k) {
        const Vec3 n = mesh.normals[face[k]];
        const Vec3 p = mesh.positions[face[k]];
        const Vec3 next = in_plane(mesh.positions[face[(k + 1) % 3]] - p, n);
        const Vec3 last = in_plane(mesh.positions[face[(k + 2) % 3]] - p, n);
        const double angle = std::acos(std::clamp(dot(next, last), -1.0, 1.0));
        sums_[first_[face[k]]][tangent.orientation] += in_plane(tangent.direction, n) * angle;
      }
    }
  }

  [[nodiscard]] std::array<float, 4> tangent(uint32_t vertex, Orientation orientation,
                                             Vec3 normal) const {
    Vec3 t = in_plane(sums_[first_[vertex]][orientation], normal);
    if (t == Vec3{}) t = any_perpendicular(normal);
    const Vec3f unit(t);
    return {unit.x, unit.y, unit.z, orientation == Plain ? 1.0F : -1.0F};
  }

 private:
  std::vector<uint32_t> first_;
  std::vector<std::array<Vec3, 2>> sums_;
};

}  // namespace

Vec3 polygon_area_vector(std::span<const Vec3> corners) {
  Vec3 sum;
  for (size_t i = 1; i + 1 < corners.size(); ++i)
    sum += cross(corners[i] - corners[0], corners[i + 1] - corners[0]);
  return sum;
}

Triangulation triangulate(std::span<const Vec3> corners) {
  const std::vector<uint32_t> kept = distinct_corners(corners);
  if (kept.size() < 3) return {};
  const Vec3 normal = polygon_area_vector(corners);
  const Box bounds = box_of(corners);
  const double extent = largest(bounds.high - bounds.low);
  constexpr double kFlat = 1e-14;
  if (!(length(normal) > kFlat * extent * extent)) return {};

  std::vector<Vec2> points;
  points.reserve(kept.size());
  for (const uint32_t i : kept) points.push_back(project(corners[i] - corners[0], normal));
  Triangulation result =
      is_convex(points) ? fan(points.size()) : EarClipper(std::move(points)).run();
  for (auto& triangle : result.triangles)
    for (uint32_t& corner : triangle) corner = kept[corner];
  return result;
}

MeshRepairs& MeshRepairs::operator+=(const MeshRepairs& others) {
  dropped_triangles += others.dropped_triangles;
  recomputed_normals += others.recomputed_normals;
  return *this;
}

void MeshRepairs::write(SceneDescription& scene) const {
  if (dropped_triangles > 0)
    scene.notes.push_back(fmt::format("{} triangles without an area dropped", dropped_triangles));
  if (recomputed_normals > 0)
    scene.notes.push_back(fmt::format("{} unusable normals recomputed", recomputed_normals));
}

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

void split_vertices(TriangleMesh& mesh) {
  std::vector<uint32_t> from;
  from.reserve(mesh.triangles.size() * 3);
  for (auto& triangle : mesh.triangles) {
    const auto first = static_cast<uint32_t>(from.size());
    from.insert(from.end(), triangle.begin(), triangle.end());
    triangle = {first, first + 1, first + 2};
  }
  select_vertices(mesh, from);
}

void compute_tangents(TriangleMesh& mesh, bool use_second_uvs) {
  const auto has_uvs = [&] { return !(use_second_uvs ? mesh.uvs2 : mesh.uvs).empty(); };
  if (!has_uvs() || mesh.triangles.size() > kMaxVertices / 3) return;
  if (mesh.normals.empty()) make_flat(mesh);
  const Uvs uvs = use_second_uvs ? mesh.uvs2 : mesh.uvs;
  const TangentSums sums(mesh, uvs);

  // A vertex keeps the orientation of its first face; a copy takes the other one.
  constexpr uint32_t kNone = ~0U;
  const size_t count = mesh.positions.size();
  std::vector<Orientation> orientations(count, Degenerate);
  std::vector<uint32_t> copies(count, kNone);
  std::vector<uint32_t> from(count);
  std::iota(from.begin(), from.end(), 0U);
  for (auto& face : mesh.triangles) {
    const Orientation orientation = face_tangent(mesh, uvs, face).orientation;
    if (orientation == Degenerate) continue;
    for (uint32_t& corner : face) {
      if (orientations[corner] == Degenerate) orientations[corner] = orientation;
      if (orientations[corner] == orientation) continue;
      if (copies[corner] == kNone) {
        copies[corner] = static_cast<uint32_t>(from.size());
        from.push_back(corner);
        orientations.push_back(orientation);
        copies.push_back(kNone);
      }
      corner = copies[corner];
    }
  }
  if (from.size() > count) select_vertices(mesh, from);
  mesh.tangents.resize(from.size());
  for (size_t i = 0; i < from.size(); ++i)
    mesh.tangents[i] =
        sums.tangent(from[i], orientations[i] == Mirrored ? Mirrored : Plain, mesh.normals[i]);
}

void LostDigits::add(const TriangleMesh& mesh) {
  if (mesh.positions.empty()) return;
  const Box bounds = box_of(mesh.positions);
  const double size = largest_size(bounds.high - bounds.low);
  const double farthest = std::max(largest_size(bounds.low), largest_size(bounds.high));
  const double step = farthest * double{std::numeric_limits<float>::epsilon()};
  constexpr double kVisible = 1e-4;  // about half a pixel of a mesh that fills a 4K panel
  if (!(step > kVisible * size) || size == 0.0) return;
  ++meshes_;
  if (step / size <= coarsest_) return;
  coarsest_ = step / size;
  step_ = step;
}

void LostDigits::write(SceneDescription& scene) const {
  if (meshes_ == 0) return;
  scene.notes.push_back(
      fmt::format("{} meshes lie far from the origin: in the file's single precision their "
                  "coordinates have steps of {:.2g} units, {:.2g} % of a mesh; move them to the "
                  "origin before exporting",
                  meshes_, step_, 100.0 * coarsest_));
}

const char* flaw_of(Vec3 position) {
  if (!is_finite(position)) return "not finite";
  return largest_size(position) > kMaxCoordinate ? "too far away" : nullptr;
}

std::array<float, 2> usable_uv(double u, double v) {
  if (!(std::abs(u) < kFarthestUv && std::abs(v) < kFarthestUv)) return {0.0F, 0.0F};
  return {static_cast<float>(u), static_cast<float>(v)};
}

std::array<float, 4> light_of(double red, double green, double blue, double alpha) {
  const auto share = [](double v) { return std::isfinite(v) ? std::clamp(v, 0.0, 1.0) : 0.0; };
  const auto light = [&](double v) {
    return static_cast<float>(frames::linear_from_srgb(share(v)));
  };
  return {light(red), light(green), light(blue), static_cast<float>(share(alpha))};
}

void add_only_mesh(TriangleMesh mesh, int texture, bool single_precision, SceneDescription& scene) {
  Material material{.name = "surface",
                    .colour = Vec3{1, 1, 1} * (texture >= 0 ? 1.0 : double{kPlainGrey}),
                    .specular = 0.06,
                    .shine = 10.0,
                    .texture = texture};
  if (!mesh.colours.empty()) {
    PbrMaterial pbr;
    pbr.metallic = 0.0;
    pbr.double_sided = true;
    pbr.base_colour_texture.texture = texture;
    material.pbr = std::make_shared<const PbrMaterial>(pbr);
  }
  scene.materials.push_back(material);
  LostDigits digits;
  if (single_precision) digits.add(mesh);
  clean(mesh).write(scene);
  if (mesh.triangles.empty()) refuse_empty(scene);
  digits.write(scene);
  scene.meshes.push_back(std::move(mesh));
}

}  // namespace lenticule::render
