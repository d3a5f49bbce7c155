// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/animation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "base/error_kinds.h"
#include "base/file.h"
#include "render/loaders/formats.h"
#include "render/loaders/mesh_cleanup.h"
#include "render/loaders/text_reader.h"
#include "render/scene/stage.h"

namespace lenticule::render {
namespace {

constexpr uintmax_t kMaxPathFileBytes = uintmax_t{64} << 20;
constexpr size_t kMaxPoses = 1'000'000;

constexpr size_t kNumbersOfAPose = 9;

/// Returns the numbers of the next line that has any: nine, or ten with the field of view.
std::vector<double> line_of_numbers(TextReader& reader) {
  std::vector<double> numbers{reader.number("the camera's place")};
  while (reader.more_on_line() && numbers.size() <= kNumbersOfAPose)
    numbers.push_back(reader.number("a pose's number"));
  if (numbers.size() < kNumbersOfAPose)
    reader.fail(
        fmt::format("a pose has nine numbers (from, at, up) or ten, not {}", numbers.size()));
  if (reader.more_on_line()) reader.fail("more than ten numbers in a pose");
  for (const double value : numbers)
    if (value < -kMaxCoordinate || value > kMaxCoordinate)
      reader.fail(fmt::format("{:g} is out of range", value));
  return numbers;
}

Camera pose(const std::vector<double>& n, double vertical_fov_degrees, const TextReader& reader) {
  Camera camera;
  camera.name = fmt::format("pose at line {}", reader.line());
  camera.from = {n[0], n[1], n[2]};
  camera.at = {n[3], n[4], n[5]};
  camera.up = {n[6], n[7], n[8]};
  camera.vertical_fov_degrees = vertical_fov_degrees;
  if (camera.from == camera.at) reader.fail("from and at are the same point");
  if (!up_is_usable(camera)) reader.fail("up is parallel to the view direction");
  return camera;
}

using Quaternion = std::array<double, 4>;

Quaternion unit(const Quaternion& q) {
  const double n = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(n > 0.0)) return {0, 0, 0, 1};
  return {q[0] / n, q[1] / n, q[2] / n, q[3] / n};
}

Vec3 mix(Vec3 a, Vec3 b, double t) { return a * (1.0 - t) + b * t; }

/// Interpolates spherically along the shorter arc.
Quaternion mix(const Quaternion& from, const Quaternion& to, double t) {
  const Quaternion a = unit(from);
  Quaternion b = unit(to);
  double cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  if (cosine < 0.0) {
    cosine = -cosine;
    for (double& v : b) v = -v;
  }
  double wa = 1.0 - t;
  double wb = t;
  constexpr double kNearlyEqual = 0.9999995;  // above it, the sine loses precision
  if (cosine < kNearlyEqual) {
    const double angle = std::acos(cosine);
    wa = std::sin((1.0 - t) * angle) / std::sin(angle);
    wb = std::sin(t * angle) / std::sin(angle);
  }
  return unit(
      {wa * a[0] + wb * b[0], wa * a[1] + wb * b[1], wa * a[2] + wb * b[2], wa * a[3] + wb * b[3]});
}

std::vector<double> mix(const std::vector<double>& a, const std::vector<double>& b, double t) {
  std::vector<double> mixed(a.size());
  for (size_t i = 0; i < a.size(); ++i) mixed[i] = a[i] * (1.0 - t) + b[i] * t;
  return mixed;
}

/// Weights of the two values and the two derivatives of a cubic Hermite spline.
using HermiteWeights = std::array<double, 4>;

HermiteWeights hermite_weights(double t, double interval) {
  const double t2 = t * t;
  const double t3 = t2 * t;
  return {2 * t3 - 3 * t2 + 1, interval * (t3 - 2 * t2 + t), 3 * t2 - 2 * t3, interval * (t3 - t2)};
}

Vec3 weighted(const HermiteWeights& w, Vec3 a, Vec3 b, Vec3 c, Vec3 d) {
  return a * w[0] + b * w[1] + c * w[2] + d * w[3];
}

/// Mixes quaternions or lists of morph weights component by component.
template <class T>
T weighted(const HermiteWeights& w, const T& a, const T& b, const T& c, const T& d) {
  T mixed = a;
  for (size_t i = 0; i < a.size(); ++i)
    mixed[i] = a[i] * w[0] + b[i] * w[1] + c[i] * w[2] + d[i] * w[3];
  return mixed;
}

/// Returns the value at a time: the first key's before the first key, the last key's after the
/// last.
template <class T>
T evaluate(const Channel<T>& channel, const T& otherwise, double seconds) {
  const std::vector<double>& times = channel.times;
  if (times.empty()) return otherwise;
  const auto next = std::upper_bound(times.begin(), times.end(), seconds);
  if (next == times.begin()) return channel.values.front();
  const auto k = static_cast<size_t>(next - times.begin()) - 1;
  if (next == times.end() || channel.steps) return channel.values[k];
  const double interval = times[k + 1] - times[k];
  const double t = (seconds - times[k]) / interval;
  if (channel.in_tangents.empty()) return mix(channel.values[k], channel.values[k + 1], t);
  return weighted(hermite_weights(t, interval), channel.values[k], channel.out_tangents[k],
                  channel.values[k + 1], channel.in_tangents[k + 1]);
}

Affine parent_from_node(const Node& node, double seconds) {
  if (!node.animated) return node.local;
  return compose(evaluate(node.translations, node.translation, seconds),
                 evaluate(node.rotations, node.rotation, seconds),
                 evaluate(node.scales, node.scale, seconds));
}

/// Transforms a normal by the transposed inverse; the sign of the determinant keeps normals outside
/// if the map mirrors. Uses cofactors instead of the inverse, which avoids a division.
Vec3 turned_normal(const Affine& a, Vec3 n) {
  const Vec3 turned = cross(a.column_y, a.column_z) * n.x + cross(a.column_z, a.column_x) * n.y +
                      cross(a.column_x, a.column_y) * n.z;
  return normalized(a.determinant() < 0.0 ? -turned : turned);
}

using Tangent = std::array<float, 4>;

Vec3 direction_of(const Tangent& t) { return Vec3(Vec3f(t[0], t[1], t[2])); }

void set_direction(Tangent& tangent, Vec3 direction) {
  Vec3f unit_direction(normalized(direction));
  if (!is_finite(unit_direction)) unit_direction = {1, 0, 0};
  tangent = {unit_direction.x, unit_direction.y, unit_direction.z, tangent[3]};
}

void turn_tangent(Tangent& tangent, const Affine& map, bool mirrors) {
  set_direction(tangent, map.vector(direction_of(tangent)));
  if (mirrors) tangent[3] = -tangent[3];
}

void require_finite(const TriangleMesh& mesh) {
  for (const Vec3& p : mesh.positions)
    if (!is_finite(p))
      throw input_error("mesh '{}': its node's transform is not finite", mesh.name);
}

/// Adds the morph targets to the vertices, each with its weight.
void morph(TriangleMesh& mesh, const Deformation& deformation, const std::vector<double>& weights) {
  const size_t targets = std::min(deformation.targets.size(), weights.size());
  for (size_t k = 0; k < targets; ++k) {
    const MorphTarget& target = deformation.targets[k];
    const double weight = weights[k];
    if (weight == 0.0) continue;
    for (size_t i = 0; i < target.positions.size(); ++i)
      mesh.positions[i] += Vec3(target.positions[i]) * weight;
    for (size_t i = 0; i < std::min(target.normals.size(), mesh.normals.size()); ++i)
      mesh.normals[i] += Vec3(target.normals[i]) * weight;
    for (size_t i = 0; i < std::min(target.tangents.size(), mesh.tangents.size()); ++i) {
      const Vec3 turned = direction_of(mesh.tangents[i]) + Vec3(target.tangents[i]) * weight;
      set_direction(mesh.tangents[i], turned);
    }
  }
}

Affine plus(const Affine& a, const Affine& b, double weight) {
  return {a.column_x + b.column_x * weight, a.column_y + b.column_y * weight,
          a.column_z + b.column_z * weight, a.origin + b.origin * weight};
}

/// Moves every vertex by the weighted mean of the maps of its joints. Weights in 8 bits or in
/// single precision rarely add up to 1: far from the origin, a part in a million moves a vertex.
void skin(TriangleMesh& mesh, const Deformation& deformation, const std::vector<Affine>& joints) {
  constexpr Affine kZero{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
  const size_t per_vertex = deformation.joints_per_vertex;
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    const auto weights = std::span(deformation.weights).subspan(i * per_vertex, per_vertex);
    const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
    Affine map = kZero;
    for (size_t k = 0; k < per_vertex; ++k)
      if (weights[k] != 0.0F)
        map = plus(map, joints[deformation.joints[i * per_vertex + k]], weights[k] / sum);
    mesh.positions[i] = map.point(mesh.positions[i]);
    if (!mesh.normals.empty()) mesh.normals[i] = turned_normal(map, mesh.normals[i]);
    if (!mesh.tangents.empty()) turn_tangent(mesh.tangents[i], map, map.determinant() < 0.0);
  }
}

void bake(TriangleMesh& mesh, const SceneDescription& scene, const std::vector<Affine>& world,
          double seconds) {
  const Node& node = scene.nodes[static_cast<size_t>(mesh.node)];
  const Affine& world_from_mesh = world[static_cast<size_t>(mesh.node)];
  mesh.node = -1;
  const std::shared_ptr<const Deformation> deformation = std::move(mesh.deformation);
  mesh.deformation.reset();
  if (!deformation) return transform_mesh(mesh, world_from_mesh);
  morph(mesh, *deformation, evaluate(node.morph_weight_keys, node.morph_weights, seconds));
  if (deformation->skin < 0) {
    transform_mesh(mesh, world_from_mesh);
  } else {
    const Skin& bones = scene.skins[static_cast<size_t>(deformation->skin)];
    std::vector<Affine> joints;
    for (size_t k = 0; k < bones.joints.size(); ++k)
      joints.push_back(world[static_cast<size_t>(bones.joints[k])] * bones.joint_from_mesh[k]);
    skin(mesh, *deformation, joints);
    require_finite(mesh);
  }
  clean(mesh);  // a deformed triangle may have no area
}

// Transform a light or a camera; return false if the result is not finite.

bool transform(Light& light, const Affine& world) {
  light.position = world.point(light.position);
  light.direction = normalized(world.vector(light.direction));
  return is_finite(light.position) && is_finite(light.direction);
}

bool transform(Camera& camera, const Affine& world) {
  camera.from = world.point(camera.from);
  camera.at = world.point(camera.at);
  camera.up = normalized(world.vector(camera.up));
  return is_finite(camera.from) && is_finite(camera.at) && is_finite(camera.up);
}

/// Bakes a light or a camera.
template <class Object>
void bake(Object& object, const SceneDescription& scene, const std::vector<Affine>& world, double) {
  const auto node = static_cast<size_t>(object.node);
  object.node = -1;
  if (!transform(object, world[node]))
    throw input_error("{}: node '{}': its transform is not finite", scene.source,
                      scene.nodes[node].name);
}

/// Calls visit(object) for every object that belongs to a node.
template <class Visit>
void for_each_on_a_node(SceneDescription& scene, Visit visit) {
  const auto each = [&](auto& objects) {
    for (auto& object : objects)
      if (object.node >= 0) visit(object);
  };
  each(scene.meshes);
  each(scene.lights);
  each(scene.cameras);
}

std::vector<bool> moving_nodes(const std::vector<Node>& nodes) {
  std::vector<bool> moving(nodes.size());
  for (size_t i = 0; i < nodes.size(); ++i) {
    const int parent = nodes[i].parent;
    moving[i] = nodes[i].animated || (parent >= 0 && moving[static_cast<size_t>(parent)]);
  }
  return moving;
}

bool moves(const TriangleMesh& mesh, const SceneDescription& scene,
           const std::vector<bool>& moving) {
  const auto node = static_cast<size_t>(mesh.node);
  if (!mesh.deformation) return moving[node];
  if (!scene.nodes[node].morph_weight_keys.times.empty()) return true;
  if (mesh.deformation->skin < 0) return moving[node];
  const Skin& bones = scene.skins[static_cast<size_t>(mesh.deformation->skin)];
  return std::ranges::any_of(bones.joints,
                             [&](int joint) { return moving[static_cast<size_t>(joint)]; });
}

template <class Object>
bool moves(const Object& object, const SceneDescription&, const std::vector<bool>& moving) {
  return moving[static_cast<size_t>(object.node)];
}

}  // namespace

std::vector<Camera> parse_camera_path(std::string_view text, const std::string& source) {
  TextReader reader(text, source);
  std::vector<Camera> path;
  while (!reader.at_end()) {
    const std::vector<double> numbers = line_of_numbers(reader);
    const double fov =
        numbers.size() > kNumbersOfAPose ? numbers.back() : Camera{}.vertical_fov_degrees;
    if (fov < 1e-3 || fov > 179.0)
      reader.fail(fmt::format("field of view of {:g} degrees: not in 0.001 ... 179", fov));
    if (path.size() == kMaxPoses) reader.fail(fmt::format("more than {} poses", kMaxPoses));
    path.push_back(pose(numbers, fov, reader));
  }
  if (path.empty()) throw input_error("{}: the camera path contains no pose", source);
  return path;
}

std::vector<Camera> load_camera_path(const std::filesystem::path& file) {
  return parse_camera_path(text_of(read_whole_file(file, kMaxPathFileBytes)), file.string());
}

Affine compose(Vec3 translation, const Quaternion& rotation, Vec3 scale) {
  const auto [x, y, z, w] = unit(rotation);
  return {Vec3{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)} * scale.x,
          Vec3{2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)} * scale.y,
          Vec3{2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)} * scale.z,
          translation};
}

std::vector<Affine> world_from_nodes(const std::vector<Node>& nodes, double seconds) {
  std::vector<Affine> world(nodes.size());
  for (size_t i = 0; i < nodes.size(); ++i) {
    const int parent = nodes[i].parent;
    LENTICULE_CHECK(parent < static_cast<int>(i));
    const Affine local = parent_from_node(nodes[i], seconds);
    world[i] = parent < 0 ? local : world[static_cast<size_t>(parent)] * local;
  }
  return world;
}

void for_each_mesh(const SceneDescription& scene,
                   const std::function<void(const TriangleMesh&)>& visit) {
  for (const TriangleMesh& mesh : scene.meshes) {
    if (mesh.shape < 0) {
      visit(mesh);
      continue;
    }
    TriangleMesh moved = scene.shape_of(mesh);
    moved.name = mesh.name;
    moved.material = mesh.material;
    transform_mesh(moved, mesh.place);
    visit(moved);
  }
}

void transform_mesh(TriangleMesh& mesh, const Affine& map) {
  if (mesh.shape >= 0) {
    mesh.place = map * mesh.place;
    return;
  }
  const bool mirrors = map.determinant() < 0.0;
  for (Vec3& p : mesh.positions) p = map.point(p);
  require_finite(mesh);
  bool degenerate = false;
  for (Vec3& n : mesh.normals) {
    n = turned_normal(map, n);
    degenerate = degenerate || !is_unit(n);
  }
  for (Tangent& tangent : mesh.tangents) turn_tangent(tangent, map, mirrors);
  if (mirrors)
    for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
  if (degenerate) clean(mesh);  // the map flattens the mesh
}

void transform_scene(SceneDescription& scene, const Affine& rotation) {
  const auto outside_nodes = [&](auto& objects, auto transform_object) {
    for (auto& object : objects)
      if (object.node < 0) transform_object(object, rotation);
  };
  outside_nodes(scene.meshes, transform_mesh);
  outside_nodes(scene.lights, [](Light& light, const Affine& map) { transform(light, map); });
  outside_nodes(scene.cameras, [](Camera& camera, const Affine& map) { transform(camera, map); });
  for (Sphere& sphere : scene.spheres) sphere.centre = rotation.point(sphere.centre);
  for (Cone& cone : scene.cones) {
    cone.base = rotation.point(cone.base);
    cone.apex = rotation.point(cone.apex);
  }
  if (scene.nodes.empty()) return;
  // A new root node turns the others; it comes first, so every index grows by one.
  Node root;
  root.name = "up";
  root.local = rotation;
  for (Node& node : scene.nodes) ++node.parent;
  scene.nodes.insert(scene.nodes.begin(), root);
  for (Skin& bones : scene.skins)
    for (int& joint : bones.joints) ++joint;
  for_each_on_a_node(scene, [](auto& object) { ++object.node; });
}

void bake_still_nodes(SceneDescription& scene) {
  const std::vector<bool> moving = moving_nodes(scene.nodes);
  const std::vector<Affine> world = world_from_nodes(scene.nodes, 0.0);
  bool still = true;
  for_each_on_a_node(scene, [&](auto& object) {
    if (moves(object, scene, moving))
      still = false;
    else
      bake(object, scene, world, 0.0);
  });
  if (!still) return;
  scene.nodes.clear();
  scene.skins.clear();
}

SceneDescription at_time(const SceneDescription& scene, double seconds) {
  SceneDescription baked = scene;
  if (scene.nodes.empty()) return baked;
  const std::vector<Affine> world = world_from_nodes(scene.nodes, seconds);
  for_each_on_a_node(baked, [&](auto& object) { bake(object, scene, world, seconds); });
  baked.nodes.clear();
  baked.skins.clear();
  return baked;
}

}  // namespace lenticule::render
