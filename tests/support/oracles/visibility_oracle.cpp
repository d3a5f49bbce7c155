// SPDX-License-Identifier: Apache-2.0
#include "tests/support/oracles/visibility_oracle.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "render/accel/primitives.h"
#include "render/scene/scene.h"

namespace lenticule::test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double size_of(Vec3 p) { return std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}); }

/// Returns the distance of a line from the line through a and b; the sign states the side.
double side(Vec3 origin, Vec3 direction, Vec3 a, Vec3 b) {
  const Vec3 across = cross(direction, b - a);
  const double size = length(across);
  return size > 0.0 ? dot(across, origin - a) / size : 0.0;
}

class Oracle {
 public:
  Oracle(const render::Scene& scene, const OracleRay& ray, double start_mm,
         const OracleTolerance& tolerance)
      : scene_(scene),
        ray_(ray),
        origin_{ray.x_mm, ray.y_mm, 0.0},
        direction_{ray.tan_x, ray.tan_y, 1.0},
        start_(start_mm),
        tolerance_(tolerance),
        panel_from_scene_(scene.scene_from_panel.inverse()) {}

  void triangle(const render::MeshShape& mesh, const std::array<uint32_t, 3>& t, OracleHit hit) {
    Vec3 p[3];
    double size = size_of(origin_);
    for (size_t n = 0; n < 3; ++n) {
      p[n] = panel_from_scene_.point(Vec3(mesh.positions[t[n]]));
      size = std::max({size, size_of(p[n]), std::abs(p[n].z) * length(direction_)});
    }
    const double by = tolerance_.ray_mm + tolerance_.relative * size;
    double low = kInfinity, high = -kInfinity;
    for (size_t n = 0; n < 3; ++n) {
      const double s = side(origin_, direction_, p[n], p[(n + 1) % 3]);
      low = std::min(low, s);
      high = std::max(high, s);
    }
    if (low < -by && high > by) return;
    const Vec3 normal = cross(p[1] - p[0], p[2] - p[0]);
    const double steep = dot(normal, direction_);
    hit.met = (low >= 0.0 || high <= 0.0) && steep != 0.0;
    hit.certain = low > by || high < -by;
    const auto [least, most] = std::minmax({p[0].z, p[1].z, p[2].z});
    hit.z_mm = steep != 0.0 ? dot(normal, p[0] - origin_) / steep : least;
    const double bend = by * (1.0 + length(normal) / std::abs(steep));
    hit.z_low_mm = std::max(hit.z_mm - bend, least - by);
    hit.z_high_mm = std::min(hit.z_mm + bend, most + by);
    if (!(bend < kInfinity)) hit.z_low_mm = least - by, hit.z_high_mm = most + by;
    keep(hit);
  }

  template <class Shape>
  void curved(const Shape& shape, OracleHit hit) {
    const Box box = render::box_of(shape);
    const double size = std::max({size_of(origin_), size_of(panel_from_scene_.point(box.low)),
                                  size_of(panel_from_scene_.point(box.high))});
    const double by = tolerance_.ray_mm + tolerance_.relative * size;
    hit.z_low_mm = kInfinity;
    hit.z_high_mm = -kInfinity;
    hit.certain = true;
    int found = 0;
    for (int n = 0; n < 9; ++n) {
      const Vec3 moved = origin_ + Vec3{by * (n % 3 - 1), by * (n / 3 - 1), 0.0};
      const double z = nearest(shape, moved);
      hit.certain = hit.certain && z > -kInfinity;
      if (n == 4) hit.z_mm = z, hit.met = z > -kInfinity;
      if (!(z > -kInfinity)) continue;
      ++found;
      hit.z_low_mm = std::min(hit.z_low_mm, z - by);
      hit.z_high_mm = std::max(hit.z_high_mm, z + by);
    }
    if (found > 0) keep(hit);
  }

  [[nodiscard]] std::vector<OracleHit> take() { return std::move(hits_); }

 private:
  /// Returns z of the nearest point behind the start, or -infinity.
  template <class Shape>
  [[nodiscard]] double nearest(const Shape& shape, Vec3 origin) const {
    const render::Roots roots = render::meet(shape, scene_.scene_from_panel.point(origin),
                                             scene_.scene_from_panel.vector(direction_));
    double z = -kInfinity;
    for (int n = 0; n < roots.count; ++n)
      if (roots.t[n] <= start_) z = std::max(z, roots.t[n]);
    return z;
  }

  void keep(OracleHit& hit) {
    constexpr double kClose = 1e-4;
    if (hit.z_low_mm > start_ + kClose) return;
    if (hit.z_high_mm > start_ - kClose) hit.certain = false;
    if (hit.z_mm > start_) hit.met = false;
    hits_.push_back(hit);
  }

  const render::Scene& scene_;
  OracleRay ray_;
  Vec3 origin_, direction_;
  double start_;
  OracleTolerance tolerance_;
  Affine panel_from_scene_;
  std::vector<OracleHit> hits_;
};

}  // namespace

OracleRay oracle_ray(const optics::OpticalModel& model, int i, int j, int channel) {
  const optics::SubpixelRay ray = model.ray(i, j, channel);
  return {ray.lens_x_mm, ray.lens_y_mm, ray.tan_x, ray.tan_y};
}

std::vector<OracleHit> oracle_hits(const render::Scene& scene, const OracleRay& ray,
                                   double start_mm, const OracleTolerance& tolerance) {
  const render::Scene& impl = scene;
  Oracle oracle(impl, ray, start_mm, tolerance);
  for (uint32_t g = 0; g < impl.geometries.size(); ++g) {
    using Kind = render::GeometryEntry::Kind;
    const render::GeometryEntry& entry = impl.geometries[g];
    uint32_t n = 0;
    if (entry.kind == Kind::Mesh)
      for (const auto& t : impl.meshes[entry.mesh].triangles)
        oracle.triangle(impl.meshes[entry.mesh], t, {.geometry = g, .primitive = n++});
    if (entry.kind == Kind::Spheres)
      for (const auto& sphere : impl.spheres)
        oracle.curved(sphere, {.geometry = g, .primitive = n++});
    if (entry.kind == Kind::Cones)
      for (const auto& cone : impl.cones) oracle.curved(cone, {.geometry = g, .primitive = n++});
  }
  return oracle.take();
}

Evaluation evaluate(const std::vector<OracleHit>& hits, const SeenSurface& seen) {
  const OracleHit* nearest = nullptr;
  const OracleHit* named = nullptr;
  double certain_z = -kInfinity;
  for (const OracleHit& hit : hits) {
    if (hit.met && (!nearest || hit.z_mm > nearest->z_mm)) nearest = &hit;
    if (hit.certain) certain_z = std::max(certain_z, hit.z_low_mm);
    if (hit.geometry == seen.geometry && hit.primitive == seen.primitive) named = &hit;
  }
  if (seen.nothing) {
    if (!nearest) return Evaluation::Right;
    return certain_z > -kInfinity ? Evaluation::Wrong : Evaluation::Close;
  }
  if (!named || seen.z_mm < named->z_low_mm || seen.z_mm > named->z_high_mm)
    return Evaluation::Wrong;
  if (named == nearest) return Evaluation::Right;
  return named->z_high_mm >= certain_z ? Evaluation::Close : Evaluation::Wrong;
}

}  // namespace lenticule::test
