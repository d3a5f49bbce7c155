// SPDX-License-Identifier: Apache-2.0
#include "render/integrator/hole_guard.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/lanes.h"
#include "render/accel/ray_stream.h"

namespace lenticule::render {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Thresholds in steps between neighbouring rays: distance by which a suspect ray must end farther
// than the nearer of its neighbours (kDrop), and farther than both (kSpike). Smooth surfaces seen
// at more than four degrees stay below both.
constexpr float kDrop = 16.0F;
constexpr float kSpike = 1.0F;

// Fractions of (largest coordinate + distance), in which single precision has a resolution of
// 2^-24: offset of the four test rays (kHair), and largest distance of the ray from a corner
// (kCorner). Rays that pass through pinholes pass within 2^-22.
constexpr double kHair = 0x1p-19;
constexpr double kCorner = 0x1p-20;
// Multiple of kHair: a hit sooner by more than this is on another surface, not on the slope of the
// same surface.
constexpr double kMuchSooner = 64.0;

// Four lanes: compilers generate poor code for wider vectors.
constexpr size_t kFour = 4;
using Floats = lanes::Vector<float, kFour>;
using Masks = lanes::Vector<int32_t, kFour>;

/// Returns the mask of the lanes that continue past the hits of their neighbours `before` and
/// `after`.
Masks stick_out(Floats t, Floats before, Floats after, float step) {
  const Masks is_before_nearer = before < after;
  const Floats nearer = is_before_nearer ? before : after;
  const Floats farther = is_before_nearer ? after : before;
  return (t > nearer + kDrop * step) | (t > farther + kSpike * step);
}

/// Returns a mask with bit r set if lane r continues past the hits of its neighbours.
uint32_t suspects(const RayPacket& packet, float step) {
  // Inactive lanes count as rays without a hit, as do those before the first and after the last.
  constexpr Floats kNone = {kInfinity, kInfinity, kInfinity, kInfinity};
  constexpr size_t kFours = kPacket / kFour;
  std::array<Floats, kFours + 2> t;
  std::array<Masks, kFours> valid;
  std::memcpy(valid.data(), packet.valid, sizeof valid);
  std::memcpy(&t[1], packet.rays.ray.tfar, sizeof valid);
  t.front() = t.back() = kNone;
  for (size_t k = 0; k < kFours; ++k) t[k + 1] = valid[k] ? t[k + 1] : kNone;
  for (size_t k = 0; k < kFours; ++k) {
    const Floats before = __builtin_shufflevector(t[k], t[k + 1], 3, 4, 5, 6);
    const Floats after = __builtin_shufflevector(t[k + 1], t[k + 2], 1, 2, 3, 4);
    valid[k] &= stick_out(t[k + 1], before, after, step);
  }
  alignas(16) int suspect[kPacket];
  std::memcpy(suspect, valid.data(), sizeof suspect);
  return lane_bits(suspect);
}

struct Line {
  Vec3 origin;
  Vec3 direction;  // unit
};

/// Returns a unit vector perpendicular to `unit`.
Vec3 across(Vec3 unit) {
  const Vec3 aside = std::abs(unit.x) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  return normalized(cross(unit, aside));
}

RTCRayHit trace(const Scene& scene, const Line& line) {
  RTCRayHit found = single_ray(Vec3f(line.origin), Vec3f(line.direction), kInfinity);
  intersect1(scene.embree.get(), found);
  return found;
}

bool passes_corner(const Scene& scene, const RTCHit& hit, const Line& line, double within) {
  const GeometryEntry& geometry = scene.geometries[hit.geomID];
  if (geometry.kind != GeometryEntry::Kind::Mesh) return false;
  const MeshShape& mesh = scene.meshes[geometry.mesh];
  const auto near = [&](uint32_t vertex) {
    const Vec3 from_origin = Vec3(mesh.positions[vertex]) - line.origin;
    return length(cross(from_origin, line.direction)) <= within;
  };
  return std::ranges::any_of(mesh.triangles[hit.primID], near);
}

/// Returns true if a ray ends sooner than `distance`.
bool ends_before(const RTCRayHit& ray, double distance) {
  return ray.hit.geomID != RTC_INVALID_GEOMETRY_ID && double{ray.ray.tfar} < distance;
}

/// SecondLook retraces one lane of a packet as a single ray.
class SecondLook {
 public:
  /// `reach` is the ray parameter at which the neighbours end.
  SecondLook(const Scene& scene, RayPacket& packet, size_t lane, double reach)
      : scene_(scene), packet_(packet), lane_(lane) {
    const RTCRay16& rays = packet.rays.ray;
    const Vec3 way{double{rays.dir_x[lane]}, double{rays.dir_y[lane]}, double{rays.dir_z[lane]}};
    const Vec3 from{double{rays.org_x[lane]}, double{rays.org_y[lane]}, double{rays.org_z[lane]}};
    stretch_ = length(way);
    line_ = {from, way / stretch_};
    size_ = std::max({std::abs(from.x), std::abs(from.y), std::abs(from.z)}) + reach * stretch_;
  }

  /// Returns true if the ray had passed through a pinhole; the lane then holds the repaired hit.
  bool fill() {
    const double hair = kHair * size_;
    const double much_sooner = double{packet_.rays.ray.tfar[lane_]} * stretch_ - kMuchSooner * hair;
    const Vec3 side = across(line_.direction) * hair;
    const Vec3 other_side = cross(line_.direction, side);
    const std::array<Vec3, 4> around = {side, -side, other_side, -other_side};
    std::array<RTCRayHit, 4> found;
    for (size_t k = 0; k < around.size(); ++k) {
      found[k] = trace(scene_, {line_.origin + around[k], line_.direction});
      if (!ends_before(found[k], much_sooner)) return false;
      // Traced alone, the ray may hit the surface that it missed in the packet.
      if (k != 0) continue;
      const RTCRayHit alone = trace(scene_, line_);
      if (ends_before(alone, much_sooner)) return take(alone);
    }
    for (const RTCRayHit& beside : found)
      if (passes_corner(scene_, beside.hit, line_, kCorner * size_)) return take(beside);
    return false;
  }

 private:
  bool take(const RTCRayHit& met) {
    packet_.rays.ray.tfar[lane_] = static_cast<float>(double{met.ray.tfar} / stretch_);
    packet_.rays.hit.geomID[lane_] = met.hit.geomID;
    packet_.rays.hit.primID[lane_] = met.hit.primID;
    return true;
  }

  const Scene& scene_;
  RayPacket& packet_;
  size_t lane_;
  Line line_;
  double stretch_ = 1.0;
  double size_ = 0.0;  ///< largest coordinate used to trace the ray up to `reach`
};

/// Returns the ray parameter of the nearer of a lane's neighbours.
double nearer_neighbour(const RayPacket& packet, size_t r) {
  float t = kInfinity;
  if (r > 0 && packet.valid[r - 1] != 0) t = std::min(t, packet.rays.ray.tfar[r - 1]);
  if (r + 1 < kPacket && packet.valid[r + 1] != 0) t = std::min(t, packet.rays.ray.tfar[r + 1]);
  return double{t};
}

}  // namespace

void fill_holes(const Scene& scene, double step_mm, RayPacket& packet, FrameCounts& counts) {
  const auto step = static_cast<float>(step_mm);
  uint32_t looked_at = 0;
  // A repaired lane can reveal a pinhole in the lane beside it.
  for (bool again = true; again;) {
    again = false;
    const uint32_t now = suspects(packet, step) & ~looked_at;
    if (now == 0) return;
    for (size_t r = 0; r < kPacket; ++r) {
      if ((now >> r & 1U) == 0) continue;
      ++counts.suspected_holes;
      if (!SecondLook(scene, packet, r, nearer_neighbour(packet, r)).fill()) continue;
      ++counts.filled_holes;
      again = true;
    }
    looked_at |= now;
  }
}

}  // namespace lenticule::render
