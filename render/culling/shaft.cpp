// SPDX-License-Identifier: Apache-2.0
#include "render/culling/shaft.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "render/accel/primitives.h"

namespace lenticule::render {
namespace {

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
        radius + double{kRoundingMargin} * (radius + double{largest_size(Vec3f(middle))});
    const Vec3 half{reach, reach, reach};
    add(geometry, primitive, Vec3f(middle - half), Vec3f(middle + half));
  };
  const auto add_with_room = [&](size_t geometry, size_t primitive, const Box& box) {
    const double margin = double{kRoundingMargin} *
                          double{largest_size(Vec3f(box.low)) + largest_size(Vec3f(box.high))};
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
      const auto [a, b, c] = mesh.corners(i);
      add(g, i, min(min(a, b), c), max(max(a, b), c));
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

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

constexpr float kMargin = kRoundingMargin;
/// Height limit relative to reach, below which a point counts as in the patch's plane: secondary
/// rays start at a height of 2^-19 of the reach.
constexpr float kFlatness = 1.0F / (1 << 22);
/// Rounding error of products of unit vectors; less than kMargin.
constexpr float kUnitRounding = 1e-6F;
/// Smallest sine of the angle to the patch's plane at which rays leave the plane fast enough for
/// rounding not to matter.
constexpr float kLeastAscent = 1e-4F;

Patch triangle_patch(const Scene& scene, const MeshShape& mesh, const SurfaceCell& cell) {
  const WideTriangle* wide = scene.wide_triangle(mesh, cell.primitive);
  const std::array<Vec3f, 3> corners = mesh.corners(cell.primitive);
  const Vec3f a = corners[0], edge1 = corners[1] - a, edge2 = corners[2] - a;
  const float part = 1.0F / static_cast<float>(cell.divisions);
  const auto at = [&](float du, float dv) {
    return a + edge1 * ((static_cast<float>(cell.u) + du) * part) +
           edge2 * ((static_cast<float>(cell.v) + dv) * part);
  };
  const float extent = std::max(largest_size(edge1), largest_size(edge2));
  Patch patch{.centre = at(0.5F, 0.5F), .extent = extent, .flat = true};
  for (const float du : {0.0F, 1.0F})
    for (const float dv : {0.0F, 1.0F})
      patch.radius = std::max(patch.radius, length(at(du, dv) - patch.centre));
  const Vec3 outer = wide != nullptr ? wide->normal : normalized(cross(Vec3(edge1), Vec3(edge2)));
  const Vec3 normal = cell.outer_side ? outer : -outer;
  patch.normal = Vec3f(normal);
  // Rays start closer to a wide triangle than its extent suggests.
  const float reach = wide != nullptr ? static_cast<float>(wide->reach) : extent;
  const float near = std::max(0.0F, largest_size(patch.centre) - patch.radius);
  const Vec3 corner = wide != nullptr ? wide->corner[0] : Vec3(a);
  const float rises = kFlatness * ((wide != nullptr ? near : largest_size(patch.centre)) + reach);
  patch.exact_normal = normal;
  patch.exact_height = dot(normal, corner) + double{rises};
  patch.height = static_cast<float>(dot(normal, corner)) + rises;
  // Directions are rounded by a few units in the last place, and secondary rays start 2^-19 above
  // their plane.
  patch.level = largest_size(patch.centre) - patch.radius + reach;
  return patch;
}

Patch sphere_patch(const SphereShape& sphere, const SurfaceCell& cell) {
  const DirectionCell from_centre = direction_cell(cell.u, cell.v, cell.divisions);
  const auto radius = static_cast<float>(sphere.radius);
  // Chord from the centre of the cap to its rim.
  const float chord = std::sqrt(std::max(0.0F, 2.0F - 2.0F * from_centre.cosine));
  return {.centre = Vec3f(sphere.centre) + from_centre.middle * radius,
          .radius = radius * chord,
          .extent = radius,
          .leaves_convex = cell.outer_side != sphere.inward};
}

Patch cone_patch(const ConeShape& cone, const SurfaceCell& cell) {
  const DirectionCell across = direction_cell(cell.u, cell.v, cell.divisions);
  const Vec3f axis(cone.axis);
  const auto height = static_cast<float>(cone.height);
  const float step = height / static_cast<float>(cell.divisions_along);
  const float begin = step * static_cast<float>(cell.w);
  const auto radius_at = [&](float s) {
    return static_cast<float>(cone.base_radius) + static_cast<float>(cone.slope) * s;
  };
  const float widest = std::max(radius_at(begin), radius_at(begin + step));
  Patch patch{.extent = height + widest, .leaves_convex = cell.outer_side != cone.inward};
  patch.centre = Vec3f(cone.base) + axis * (begin + 0.5F * step);
  patch.radius = widest + 0.5F * step;
  // The cell of directions may contain no direction across the axis, or many; then the patch is the
  // whole ring.
  const Vec3f flat = across.middle - axis * dot(across.middle, axis);
  if (length(flat) < 0.5F || across.cosine < 0.5F) return patch;
  // A direction across the axis is no farther from `flat` than twice the cell's radius.
  const float chord = 2.0F * std::sqrt(std::max(0.0F, 2.0F - 2.0F * across.cosine));
  patch.centre = patch.centre + normalized(flat) * widest;
  patch.radius =
      std::min(patch.radius + widest,
               0.5F * step * (1.0F + std::abs(static_cast<float>(cone.slope))) + widest * chord);
  return patch;
}

}  // namespace

Patch patch_of(const Scene& scene, const SurfaceCell& cell) {
  const GeometryEntry& entry = scene.geometries[cell.geometry];
  Patch patch = entry.kind == GeometryEntry::Kind::Mesh
                    ? triangle_patch(scene, scene.meshes[entry.mesh], cell)
                : entry.kind == GeometryEntry::Kind::Spheres
                    ? sphere_patch(scene.spheres[cell.primitive], cell)
                    : cone_patch(scene.cones[cell.primitive], cell);
  // Secondary rays start off a patch by a fraction of its extent and of its coordinates.
  patch.radius += kMargin * (largest_size(patch.centre) + patch.radius + patch.extent);
  patch.geometry = cell.geometry;
  patch.primitive = cell.primitive;
  return patch;
}

namespace {

struct Shaft {
  Patch from{};
  bool to_point = false;
  Vec3f point{};      ///< end of all rays, or the centre of the ball in which the rays end
  float ball = 0.0F;  ///< radius of the ball
  Vec3f axis{};       ///< unit; centre of the cone of directions
  float sine = 0.0F;  ///< sine of half the cone's opening, which is below a right angle
  float cosine = 1.0F;
  float within = 0.0F;  ///< if not zero, the shaft holds rays of this length in any direction
};

/// Returns the shaft into a ball, or to a point if the radius is 0.
Shaft shaft_to(const Patch& from, Vec3 middle, double radius) {
  Shaft shaft{.from = from,
              .to_point = true,
              .point = Vec3f(middle),
              .ball = static_cast<float>(radius) * (1.0F + kMargin)};
  const Vec3f way = shaft.point - from.centre;
  // The direction of a ray is rounded too; the resulting error grows with the distance.
  shaft.from.radius += kMargin * length(way);
  shaft.axis = normalized(way);
  return shaft;
}

Shaft shaft_in_cone(const Patch& from, Vec3f axis, float cosine) {
  Shaft shaft{.from = from, .axis = axis};
  // Slightly wider, for the rounding of directions.
  shaft.cosine = cosine - kMargin;
  shaft.sine = std::sqrt(std::max(0.0F, 1.0F - shaft.cosine * shaft.cosine)) + kMargin;
  return shaft;
}

Shaft shaft_around(const Patch& from, double length) {
  Shaft shaft{.from = from, .within = static_cast<float>(length) * (1.0F + kMargin)};
  shaft.from.radius += shaft.within;
  return shaft;
}

/// Hull is the convex hull of a shaft, for tests against separating planes.
class Hull {
 public:
  explicit Hull(const Shaft& shaft) : shaft_(shaft) {
    for (int i = 0; i < 3; ++i) {
      Vec3f unit{i == 0 ? 1.0F : 0.0F, i == 1 ? 1.0F : 0.0F, i == 2 ? 1.0F : 0.0F};
      high_[i] = reach(unit);
      low_[i] = -reach(-unit);
    }
    above_ = shaft.from.flat &&
             (shaft.within > 0.0F ? shaft.within < shaft.from.level : ascent() > kLeastAscent);
  }

  /// Returns the largest n . p of the hull's points; n is unit.
  [[nodiscard]] float reach(Vec3f n) const {
    const float start = dot(shaft_.from.centre, n) + shaft_.from.radius;
    if (shaft_.within > 0.0F) return start;
    if (shaft_.to_point)
      return std::max(start,
                      dot(shaft_.point, n) + shaft_.ball + kMargin * largest_size(shaft_.point));
    return dot(shaft_.axis, n) <= -shaft_.sine + kUnitRounding ? start : kInfinity;
  }

  [[nodiscard]] bool misses_box(Vec3f low, Vec3f high) const {
    if (low.x > high_[0] || high.x < low_[0] || low.y > high_[1] || high.y < low_[1] ||
        low.z > high_[2] || high.z < low_[2])
      return true;
    const Vec3f middle = (low + high) * 0.5F;
    const Vec3f half = (high - low) * 0.5F;
    const auto spread = [&](Vec3f n) {
      return std::abs(half.x * n.x) + std::abs(half.y * n.y) + std::abs(half.z * n.z);
    };
    const Patch& from = shaft_.from;
    if (above_ && dot(from.normal, middle) + spread(from.normal) <= from.height) return true;
    const Vec3f n = toward(middle);
    return dot(middle, n) - spread(n) > reach(n);
  }

  [[nodiscard]] bool misses_triangle(Vec3f a, Vec3f b, Vec3f c) const {
    const Patch& from = shaft_.from;
    if (above_ &&
        std::max({dot(from.normal, a), dot(from.normal, b), dot(from.normal, c)}) <= from.height)
      return true;
    return passes_triangle(a, b, c, 0.0F);
  }

  /// Tests a wide triangle in double precision, since single precision is too coarse for its
  /// corners.
  [[nodiscard]] bool misses_wide_triangle(const WideTriangle& triangle) const {
    const auto& [a, b, c] = triangle.corner;
    const Patch& from = shaft_.from;
    if (above_ && std::max({dot(from.exact_normal, a), dot(from.exact_normal, b),
                            dot(from.exact_normal, c)}) <= from.exact_height)
      return true;
    const float room =
        kMargin * (largest_size(Vec3f(a)) + largest_size(Vec3f(b)) + largest_size(Vec3f(c)));
    return passes_triangle(Vec3f(a), Vec3f(b), Vec3f(c), room);
  }

  [[nodiscard]] bool misses_sphere(Vec3f centre, float radius) const {
    const Vec3f n = toward(centre);
    return dot(centre, n) - radius > reach(n);
  }

 private:
  /// Returns true if a plane separates the hull from a triangle whose corners are rounded by at
  /// most `room`.
  [[nodiscard]] bool passes_triangle(Vec3f a, Vec3f b, Vec3f c, float room) const {
    const auto apart = [&](Vec3f n) {
      return std::min({dot(a, n), dot(b, n), dot(c, n)}) - room > reach(n);
    };
    if (apart(toward((a + b + c) * (1.0F / 3.0F)))) return true;
    const Vec3f plane = normalized(cross(b - a, c - a));
    if (apart(plane) || apart(-plane)) return true;
    for (const Vec3f edge : {b - a, c - b, a - c}) {
      const Vec3f n = normalized(cross(edge, shaft_.axis));
      if (apart(lean(n)) || apart(lean(-n))) return true;
    }
    return false;
  }

  /// Tilts a normal across the axis back until the cone of directions lies behind its plane.
  [[nodiscard]] Vec3f lean(Vec3f across) const {
    return shaft_.to_point ? across : across * shaft_.cosine - shaft_.axis * shaft_.sine;
  }

  /// Returns the normal of a plane that is likely to separate the hull from a point.
  [[nodiscard]] Vec3f toward(Vec3f p) const {
    const Vec3f way = p - shaft_.from.centre;
    float along = std::max(0.0F, dot(way, shaft_.axis));
    const bool beside = along > 0.0F;
    if (shaft_.to_point) along = std::min(along, length(shaft_.point - shaft_.from.centre));
    const Vec3f off = normalized(way - shaft_.axis * along);
    return beside ? lean(off) : off;
  }

  /// Returns the smallest sine of the angle between a ray and the patch's plane.
  [[nodiscard]] float ascent() const {
    const Patch& from = shaft_.from;
    if (shaft_.to_point)
      return (dot(from.normal, shaft_.point) - shaft_.ball - from.height) /
             (length(shaft_.point - from.centre) + from.radius + shaft_.ball);
    const float sine = dot(from.normal, shaft_.axis);
    const float cosine = std::sqrt(std::max(0.0F, 1.0F - sine * sine));
    return sine * shaft_.cosine - cosine * shaft_.sine;
  }

  const Shaft& shaft_;
  std::array<float, 3> low_{}, high_{};
  bool above_ = false;  ///< all rays rise above the patch's plane
};

/// Obstacles tests if a single primitive blocks all rays from a patch to a point or into a ball.
/// All rays are segments. At the fraction f of their length they are within (1 - f) patch radii
/// plus f ball radii of the middle ray.
class Obstacles {
 public:
  explicit Obstacles(const Shaft& shaft)
      : from_(shaft.from),
        point_(shaft.point),
        ball_(shaft.ball),
        way_(shaft.point - shaft.from.centre) {
    for (int i = 0; i < 3; ++i) inverse_[i] = 1.0F / part(way_, i);
    squared_ = dot(way_, way_);
  }

  /// Returns true if the middle ray reaches the box: a primitive that blocks all rays blocks the
  /// middle one.
  [[nodiscard]] bool reaches_box(Vec3f low, Vec3f high) const {
    float enter = 0.0F, leave = 1.0F;
    for (int i = 0; i < 3; ++i) {
      const float a = (part(low, i) - part(from_.centre, i)) * inverse_[i];
      const float b = (part(high, i) - part(from_.centre, i)) * inverse_[i];
      // Zero times infinity is NaN: the ray lies in the box's plane and may pass.
      enter = std::fmax(enter, std::fmin(a, b));
      leave = std::fmin(leave, std::fmax(a, b));
    }
    return enter <= leave;
  }

  /// Returns true if a point of each ray lies inside the sphere, and both ends of each ray lie
  /// outside.
  [[nodiscard]] bool behind_sphere(Vec3f centre, float radius) const {
    const float margin = kMargin * (radius + largest_size(centre) + largest_size(point_));
    const float part_way = dot(centre - from_.centre, way_) / squared_;
    if (!(part_way > 0.0F && part_way < 1.0F)) return false;
    const float off = length(from_.centre + way_ * part_way - centre);
    return off + from_.radius * (1.0F - part_way) + ball_ * part_way + margin < radius &&
           length(centre - point_) > radius + ball_ + margin &&
           length(centre - from_.centre) > radius + from_.radius + margin;
  }

  /// Returns true if the patch lies inside the pyramid from the point through the triangle, and
  /// beyond the triangle. Returns false for triangles near the point, where a wide margin at the
  /// patch shrinks to nothing.
  [[nodiscard]] bool behind_triangle(Vec3f a, Vec3f b, Vec3f c) const {
    if (ball_ > 0.0F) return along_prism(a, b, c);
    constexpr float kNear = 0.25F;
    const Vec3f normal = normalized(cross(b - a, c - a));
    const float beyond = dot(normal, a - point_);
    if (!(std::abs(beyond) > kNear * std::abs(dot(normal, way_)))) return false;
    const Vec3f outward = beyond > 0.0F ? normal : -normal;
    const float margin =
        from_.radius + kMargin * (largest_size(a) + largest_size(b) + largest_size(c) +
                                  largest_size(point_) + largest_size(from_.centre));
    if (!(std::abs(beyond) > margin && dot(outward, from_.centre - a) > margin)) return false;
    const auto inside = [&](Vec3f p, Vec3f q, Vec3f opposite) {
      const Vec3f n = normalized(cross(p - point_, q - point_));
      const float side = dot(n, from_.centre - point_);
      return std::abs(side) > margin && (side > 0.0F) == (dot(n, opposite - point_) > 0.0F);
    };
    return inside(a, b, c) && inside(b, c, a) && inside(c, a, b);
  }

 private:
  static float part(Vec3f v, int i) { return i == 0 ? v.x : i == 1 ? v.y : v.z; }

  /// Returns true if patch and ball lie inside the prism that extends the triangle along the middle
  /// ray, on different sides of the triangle.
  [[nodiscard]] bool along_prism(Vec3f a, Vec3f b, Vec3f c) const {
    const float margin = kMargin * (largest_size(a) + largest_size(b) + largest_size(c) +
                                    largest_size(point_) + largest_size(from_.centre));
    const Vec3f normal = normalized(cross(b - a, c - a));
    const float before = dot(normal, from_.centre - a), beyond = dot(normal, point_ - a);
    if ((before > 0.0F) == (beyond > 0.0F) || !(std::abs(before) > from_.radius + margin) ||
        !(std::abs(beyond) > ball_ + margin))
      return false;
    const float widest = std::max(from_.radius, ball_) + margin;
    const auto inside = [&](Vec3f p, Vec3f q, Vec3f opposite) {
      const Vec3f across = cross(q - p, way_);
      // An edge parallel to the middle ray defines no plane after rounding.
      constexpr float kLeastSine = 0.05F;
      if (!(length(across) > kLeastSine * length(q - p) * length(way_))) return false;
      const Vec3f n = normalized(across);
      const float side = dot(n, from_.centre - p);
      return std::abs(side) > widest && (side > 0.0F) == (dot(n, opposite - p) > 0.0F);
    };
    return inside(a, b, c) && inside(b, c, a) && inside(c, a, b);
  }

  const Patch& from_;
  Vec3f point_;
  float ball_;
  Vec3f way_;  ///< vector from the patch's centre to the point
  std::array<float, 3> inverse_{};
  float squared_ = 0.0F;
};

float grown(const SphereShape& sphere) {
  const auto radius = static_cast<float>(sphere.radius);
  return radius + kMargin * (radius + largest_size(Vec3f(sphere.centre)));
}

bool blocks(const Scene& scene, const Obstacles& obstacles, const PrimitiveTree::Leaf& leaf) {
  const GeometryEntry& entry = scene.geometries[leaf.geometry];
  if (entry.kind == GeometryEntry::Kind::Cones) return false;  // open: rays may pass lengthwise
  if (entry.kind == GeometryEntry::Kind::Spheres) {
    const SphereShape& sphere = scene.spheres[leaf.primitive];
    return obstacles.behind_sphere(Vec3f(sphere.centre), static_cast<float>(sphere.radius));
  }
  const auto [a, b, c] = scene.meshes[entry.mesh].corners(leaf.primitive);
  return obstacles.behind_triangle(a, b, c);
}

bool misses_primitive(const Scene& scene, const Hull& hull, const Patch& from,
                      const PrimitiveTree::Leaf& leaf) {
  if (from.leaves_convex && leaf.geometry == from.geometry && leaf.primitive == from.primitive)
    return true;
  const GeometryEntry& entry = scene.geometries[leaf.geometry];
  if (entry.kind == GeometryEntry::Kind::Cones) return false;  // its box is in the way
  if (entry.kind == GeometryEntry::Kind::Spheres) {
    const SphereShape& sphere = scene.spheres[leaf.primitive];
    return hull.misses_sphere(Vec3f(sphere.centre), grown(sphere));
  }
  const MeshShape& mesh = scene.meshes[entry.mesh];
  if (const WideTriangle* wide = scene.wide_triangle(mesh, leaf.primitive))
    return hull.misses_wide_triangle(*wide);
  const auto [a, b, c] = mesh.corners(leaf.primitive);
  return hull.misses_triangle(a, b, c);
}

/// Returns true if no ray of the shaft meets anything; false if a ray may.
bool is_empty(const Scene& scene, const PrimitiveTree& tree, const Shaft& shaft) {
  const Hull hull(shaft);
  return !tree.search(
      true, [&](Vec3f low, Vec3f high) { return !hull.misses_box(low, high); },
      [&](const PrimitiveTree::Leaf& leaf) {
        return !misses_primitive(scene, hull, shaft.from, leaf);
      });
}

/// Returns true if every ray of the shaft meets something before its end; false if a ray may not.
/// Always false for shafts without an end, and if only several primitives together block the rays.
bool is_blocked(const Scene& scene, const PrimitiveTree& tree, const Shaft& shaft) {
  if (!shaft.to_point) return false;
  const Obstacles obstacles(shaft);
  return tree.search(
      false, [&](Vec3f low, Vec3f high) { return obstacles.reaches_box(low, high); },
      [&](const PrimitiveTree::Leaf& leaf) { return blocks(scene, obstacles, leaf); });
}

constexpr unsigned kAnswersLog2 = 20;

}  // namespace

ShaftCache::ShaftCache(const Scene& scene, const PrimitiveTree& tree) : scene_(scene), tree_(tree) {
  uint64_t first = 0;
  for (const GeometryEntry& entry : scene.geometries) {
    first_primitive_.push_back(first);
    first += entry.kind == GeometryEntry::Kind::Spheres ? scene.spheres.size()
             : entry.kind == GeometryEntry::Kind::Cones ? scene.cones.size()
                                                        : scene.meshes[entry.mesh].triangles.size();
  }
}

ShaftCache::ShaftCache(const ShaftCache& points, SoftSizes sizes)
    : scene_(points.scene_),
      tree_(points.tree_),
      sizes_(sizes),
      sun_cosine_(static_cast<float>(1.0 / std::hypot(1.0, sizes.sun_tangent))),
      first_primitive_(points.first_primitive_) {}

ShaftCache& ShaftCache::with_sizes(SoftSizes sizes) {
  if (sizes == sizes_) return *this;
  const std::lock_guard lock(adding_);
  for (const std::unique_ptr<ShaftCache>& other : others_)
    if (other->sizes_ == sizes) return *other;
  others_.push_back(std::unique_ptr<ShaftCache>(new ShaftCache(*this, sizes)));
  return *others_.back();
}

ShaftResult ShaftCache::result(const SurfaceCell& cell, uint64_t number, uint64_t target) {
  if (target >= kTargets) return ShaftResult::None;
  std::call_once(
      asked_, [this] { answers_ = std::vector<std::atomic<uint64_t>>(size_t{1} << kAnswersLog2); });
  const uint64_t key = (number * kTargets + target) << 2;
  std::atomic<uint64_t>& place = answers_[mixed(key, kAnswersLog2)];
  const uint64_t known = place.load(std::memory_order_relaxed);
  if ((known & ~uint64_t{3}) == key && known != 0) return static_cast<ShaftResult>(known & 3);
  const ShaftResult result = find_out(cell, target);
  place.store(key | static_cast<uint64_t>(result), std::memory_order_relaxed);
  return result;
}

ShaftResult ShaftCache::find_out(const SurfaceCell& cell, uint64_t target) const {
  const auto answer = [&](const Shaft& shaft) {
    if (is_empty(scene_, tree_, shaft)) return ShaftResult::Empty;
    return is_blocked(scene_, tree_, shaft) ? ShaftResult::Blocked : ShaftResult::None;
  };
  const Patch from = patch_of(scene_, cell);
  if (target < kBins) {
    const DirectionCell bin =
        direction_cell(static_cast<int>(target) / kDirectionBins,
                       static_cast<int>(target) % kDirectionBins, kDirectionBins);
    return answer(shaft_in_cone(from, bin.middle, bin.cosine));
  }
  if (target == kAround) return answer(shaft_around(from, sizes_.around));
  const SceneLight& area_light = scene_.lights[target - kBins];
  // Parallel rays: a cone as narrow as rounding allows.
  if (area_light.kind == Light::Kind::Directional)
    return answer(shaft_in_cone(from, Vec3f(-area_light.direction), sun_cosine_));
  return answer(shaft_to(from, area_light.position, sizes_.light_radius));
}

}  // namespace lenticule::render
