// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/animation.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "render/scene/scene_description.h"

namespace lenticule::render {
namespace {

using Quaternion = std::array<double, 4>;

Quaternion unit(const Quaternion& q) {
  const double n = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(n > 0.0)) return {0, 0, 0, 1};
  return {q[0] / n, q[1] / n, q[2] / n, q[3] / n};
}

Vec3 mix(Vec3 a, Vec3 b, double t) {
  return a * (1.0 - t) + b * t;
}

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
  return mix(channel.values[k], channel.values[k + 1],
             (seconds - times[k]) / (times[k + 1] - times[k]));
}

Affine compose(Vec3 translation, const Quaternion& rotation, Vec3 scale) {
  const auto [x, y, z, w] = unit(rotation);
  return {Vec3{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)} * scale.x,
          Vec3{2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)} * scale.y,
          Vec3{2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)} * scale.z,
          translation};
}

Affine parent_from_node(const Node& node, double seconds) {
  if (!node.animated) return node.local;
  return compose(evaluate(node.translations, node.translation, seconds),
                 evaluate(node.rotations, node.rotation, seconds),
                 evaluate(node.scales, node.scale, seconds));
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

/// Transforms a normal by the transposed inverse; the sign of the determinant keeps normals outside
/// if the map mirrors. Uses cofactors instead of the inverse, which avoids a division.
Vec3 turned_normal(const Affine& a, Vec3 n) {
  const Vec3 turned = cross(a.column_y, a.column_z) * n.x + cross(a.column_z, a.column_x) * n.y +
                      cross(a.column_x, a.column_y) * n.z;
  return normalized(a.determinant() < 0.0 ? -turned : turned);
}

void bake(TriangleMesh& mesh, const Affine& world) {
  for (Vec3& p : mesh.positions) {
    p = world.point(p);
    if (!is_finite(p))
      throw Error(ErrorKind::Input, "mesh '" + mesh.name + "': its node's transform is not finite");
  }
  for (Vec3& n : mesh.normals) n = turned_normal(world, n);
  if (world.determinant() < 0.0)
    for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
  mesh.node = -1;
}

void bake(Light& light, const Affine& world) {
  light.position = world.point(light.position);
  light.direction = normalized(world.vector(light.direction));
  light.node = -1;
}

void bake(Camera& camera, const Affine& world) {
  camera.from = world.point(camera.from);
  camera.at = world.point(camera.at);
  camera.up = normalized(world.vector(camera.up));
  camera.node = -1;
}

/// Calls visit(object, node) for every object that belongs to a node.
template <class Visit>
void for_each_on_a_node(SceneDescription& scene, Visit visit) {
  const auto each = [&](auto& objects) {
    for (auto& object : objects)
      if (object.node >= 0) visit(object, static_cast<size_t>(object.node));
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

}  // namespace

void bake_still_nodes(SceneDescription& scene) {
  const std::vector<bool> moving = moving_nodes(scene.nodes);
  const std::vector<Affine> world = world_from_nodes(scene.nodes, 0.0);
  for_each_on_a_node(scene, [&](auto& object, size_t node) {
    if (!moving[node]) bake(object, world[node]);
  });
  if (std::find(moving.begin(), moving.end(), true) == moving.end()) scene.nodes.clear();
}

SceneDescription at_time(const SceneDescription& scene, double seconds) {
  SceneDescription baked = scene;
  if (scene.nodes.empty()) return baked;
  const std::vector<Affine> world = world_from_nodes(scene.nodes, seconds);
  for_each_on_a_node(baked, [&](auto& object, size_t node) { bake(object, world[node]); });
  baked.nodes.clear();
  return baked;
}

}  // namespace lenticule::render
