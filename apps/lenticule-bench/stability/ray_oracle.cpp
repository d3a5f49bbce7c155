// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/stability/ray_oracle.h"

#include <cmath>
#include <limits>

namespace lenticule::bench {
namespace {

using Real = long double;

constexpr Real kFar = std::numeric_limits<Real>::infinity();

/// Identifies a primitive, so that a ray that starts on a flat one does not hit it again.
struct Name {
  const void* list = nullptr;
  size_t number = 0;
  friend bool operator==(const Name&, const Name&) = default;
};

struct Meeting {
  Real t = kFar;
  Real3 outward;  // unit, on the outer side
  int material = 0;
  Name name;
};

void keep_nearer(Meeting& nearest, Real least, const Meeting& other) {
  if (other.t > least && other.t < nearest.t) nearest = other;
}

void meet_triangle(const render::TriangleMesh& mesh, size_t k, const OracleLine& line, Real least,
                   Meeting& nearest) {
  const Real3 a(mesh.positions[mesh.triangles[k][0]]);
  const Real3 b(mesh.positions[mesh.triangles[k][1]]);
  const Real3 c(mesh.positions[mesh.triangles[k][2]]);
  const Real3 normal = cross(b - a, c - a);
  const Real facing = dot(normal, line.way);
  if (facing == 0) return;
  const Real t = dot(normal, a - line.from) / facing;
  const Real3 p = line.from + line.way * t;
  if (dot(cross(b - a, p - a), normal) < 0 || dot(cross(c - b, p - b), normal) < 0 ||
      dot(cross(a - c, p - c), normal) < 0)
    return;
  keep_nearer(nearest, least, {t, normalized(normal), mesh.material, {&mesh, k}});
}

void meet_sphere(const render::Sphere& sphere, const OracleLine& line, Real least,
                 Meeting& nearest) {
  const Real3 centre(sphere.centre);
  const Real squared = dot(line.way, line.way);
  const Real middle = dot(centre - line.from, line.way) / squared;
  const Real3 off = line.from + line.way * middle - centre;
  const Real radius = sphere.radius;
  const Real half_chord = (radius * radius - dot(off, off)) / squared;
  if (half_chord < 0) return;
  for (const Real t : {middle - std::sqrt(half_chord), middle + std::sqrt(half_chord)}) {
    const Real3 outward = normalized(line.from + line.way * t - centre);
    keep_nearer(nearest, least,
                {t, sphere.inward ? -outward : outward, sphere.material, {&sphere, 0}});
  }
}

Meeting meet_all(const render::SceneDescription& scene, const OracleLine& line, Real least,
                 const Name& except) {
  Meeting nearest;
  for (const render::TriangleMesh& mesh : scene.meshes)
    for (size_t k = 0; k < mesh.triangles.size(); ++k)
      if (!(Name{&mesh, k} == except)) meet_triangle(mesh, k, line, least, nearest);
  for (const render::Sphere& sphere : scene.spheres) meet_sphere(sphere, line, least, nearest);
  return nearest;
}

Real channel_of(const Vec3& colour, int channel) {
  return channel == 0 ? colour.x : channel == 1 ? colour.y : colour.z;
}

struct Tracer {
  const render::SceneDescription& scene;
  int channel;
  int max_depth;
  Real start_off;

  Real light(const OracleLine& line, Real least, int depth, const Name& from) const {
    const Meeting at = meet_all(scene, line, least, from);
    if (at.t == kFar) return channel_of(scene.background, channel);
    const render::Material& material = scene.materials[static_cast<size_t>(at.material)];
    Real sum = channel_of(material.emission, channel);
    if (depth == max_depth) return sum;
    const Real3 point = line.from + line.way * at.t;
    const Real3 way = normalized(line.way);
    const bool outside = dot(at.outward, way) <= 0;
    const Real3 facing = outside ? at.outward : -at.outward;
    Real mirror = material.specular;
    const Real through = material.transmittance * channel_of(material.colour, channel);
    // Snell: sin(out) = sin(in) * ratio; total reflection if it exceeds 1.
    const Real index = material.refraction_index;
    const Real ratio = outside ? 1 / index : index;
    const Real cosine = -dot(facing, way);
    const Real3 sideways = (way + facing * cosine) * ratio;
    const Real sine_squared = dot(sideways, sideways);
    if (through > 0 && sine_squared > 1) mirror += through;
    if (through > 0 && sine_squared <= 1) {
      const Real3 bent = sideways - facing * std::sqrt(1 - sine_squared);
      sum += through * light({point - facing * start_off, bent}, kLeast, depth + 1, at.name);
    }
    if (mirror > 0)
      sum += mirror * light({point + facing * start_off, way + facing * (2 * cosine)}, kLeast,
                            depth + 1, at.name);
    return sum;
  }

  static constexpr Real kLeast = 1e-11L;
};

}  // namespace

long double oracle_light(const render::SceneDescription& scene, const OracleLine& line, int channel,
                         int max_depth, long double start_off) {
  return Tracer{scene, channel, max_depth, start_off}.light(line, 0, 0, {});
}

long double oracle_distance(const render::SceneDescription& scene, const OracleLine& line) {
  return meet_all(scene, line, 0, {}).t;
}

}  // namespace lenticule::bench
