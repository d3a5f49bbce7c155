// SPDX-License-Identifier: Apache-2.0
#include "render/culling/primitive_tree.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "render/accel/primitives.h"

namespace lenticule::render {
namespace {

float largest(Vec3f v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

/// Returns the boxes of all primitives, for Embree's builder.
std::vector<RTCBuildPrimitive> boxes_of(const Scene& scene) {
  std::vector<RTCBuildPrimitive> boxes;
  const auto add = [&](size_t geometry, size_t primitive, Vec3f low, Vec3f high) {
    boxes.push_back({.lower_x = low.x,
                     .lower_y = low.y,
                     .lower_z = low.z,
                     .geomID = static_cast<unsigned>(geometry),
                     .upper_x = high.x,
                     .upper_y = high.y,
                     .upper_z = high.z,
                     .primID = static_cast<unsigned>(primitive)});
  };
  const auto add_ball = [&](size_t geometry, size_t primitive, Vec3 middle, double radius) {
    const double reach =
        radius + double{kRoundingMargin} * (radius + double{largest(Vec3f(middle))});
    const Vec3 half{reach, reach, reach};
    add(geometry, primitive, Vec3f(middle - half), Vec3f(middle + half));
  };
  const auto add_with_room = [&](size_t geometry, size_t primitive, const Box& box) {
    const double margin =
        double{kRoundingMargin} * double{largest(Vec3f(box.low)) + largest(Vec3f(box.high))};
    const Vec3 room{margin, margin, margin};
    add(geometry, primitive, Vec3f(box.low - room), Vec3f(box.high + room));
  };
  for (size_t g = 0; g < scene.geometries.size(); ++g) {
    const GeometryEntry& entry = scene.geometries[g];
    if (entry.kind == GeometryEntry::Kind::Spheres)
      for (size_t i = 0; i < scene.spheres.size(); ++i)
        add_ball(g, i, scene.spheres[i].centre, scene.spheres[i].radius);
    if (entry.kind == GeometryEntry::Kind::Cones)
      for (size_t i = 0; i < scene.cones.size(); ++i) add_with_room(g, i, box_of(scene.cones[i]));
    if (entry.kind != GeometryEntry::Kind::Mesh) continue;
    const MeshShape& mesh = scene.meshes[entry.mesh];
    for (size_t i = 0; i < mesh.triangles.size(); ++i) {
      if (const WideTriangle* wide = scene.wide_triangle(mesh, static_cast<uint32_t>(i))) {
        add_with_room(g, i, box_of(*wide));
        continue;
      }
      const Vec3f a = mesh.positions[mesh.triangles[i][0]];
      const Vec3f b = mesh.positions[mesh.triangles[i][1]];
      const Vec3f c = mesh.positions[mesh.triangles[i][2]];
      add(g, i, {std::min({a.x, b.x, c.x}), std::min({a.y, b.y, c.y}), std::min({a.z, b.z, c.z})},
          {std::max({a.x, b.x, c.x}), std::max({a.y, b.y, c.y}), std::max({a.z, b.z, c.z})});
    }
  }
  return boxes;
}

}  // namespace

/// Callbacks of Embree's builder.
struct PrimitiveTree::Builder {
  static void* make_node(RTCThreadLocalAllocator allocator) {
    return new (rtcThreadLocalAlloc(allocator, sizeof(Node), 16)) Node;
  }
  static void* create_inner(RTCThreadLocalAllocator allocator, unsigned, void*) {
    return make_node(allocator);
  }
  static void set_children(void* node, void** children, unsigned count, void*) {
    for (unsigned i = 0; i < count; ++i)
      static_cast<Node*>(node)->child[i] = static_cast<const Node*>(children[i]);
  }
  static void set_bounds(void* node, const RTCBounds** bounds, unsigned count, void*) {
    for (unsigned i = 0; i < count; ++i) {
      const RTCBounds& box = *bounds[i];
      static_cast<Node*>(node)->low[i] = {box.lower_x, box.lower_y, box.lower_z};
      static_cast<Node*>(node)->high[i] = {box.upper_x, box.upper_y, box.upper_z};
    }
  }
  static void* create_leaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* primitives,
                           size_t, void*) {
    void* node = make_node(allocator);
    static_cast<Node*>(node)->leaf = {primitives->geomID, primitives->primID};
    return node;
  }
};

PrimitiveTree::PrimitiveTree(const Scene& scene) {
  std::vector<RTCBuildPrimitive> boxes = boxes_of(scene);
  if (boxes.empty()) return;
  bvh_.reset(rtcNewBVH(scene.device.get()));
  RTCBuildArguments arguments = rtcDefaultBuildArguments();
  arguments.maxLeafSize = 1;
  arguments.maxDepth = kMostDepth;
  arguments.bvh = bvh_.get();
  arguments.primitives = boxes.data();
  arguments.primitiveCount = boxes.size();
  arguments.primitiveArrayCapacity = boxes.size();
  arguments.createNode = Builder::create_inner;
  arguments.setNodeChildren = Builder::set_children;
  arguments.setNodeBounds = Builder::set_bounds;
  arguments.createLeaf = Builder::create_leaf;
  root_ = static_cast<const Node*>(rtcBuildBVH(&arguments));
  scene.device.check("building the tree of primitives");
}

PrimitiveTree::~PrimitiveTree() = default;

}  // namespace lenticule::render
