// SPDX-License-Identifier: Apache-2.0
#include "lab/stability/oracles.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>

namespace lenticule::lab {

namespace {

struct Point {
  Real x = 0;
  Real y = 0;
};

/// Returns the panel point in millimetres, x right, y up, from the panel's centre.
Point panel_point(const optics::Rig& rig, int i, int j, int channel) {
  const optics::SubpixelOffset& in_pixel = rig.panel.layout.offset(i, j, channel);
  const Real x_px = Real(i) + Real(in_pixel.x_px) - Real(rig.panel.width_px) / 2;
  const Real y_px = Real(rig.panel.height_px) / 2 - (Real(j) + Real(in_pixel.y_px));
  return {Real(rig.panel.pixel_width.value) * x_px, Real(rig.panel.pixel_height.value) * y_px};
}

/// Returns Delta(L, E) = g r / sqrt(Ez^2 + (1 - nu) |r|^2), r = E - L.
Point shift(const optics::Rig& rig, Point lens_point, const OracleEye& eye) {
  const Real gap = rig.sheet.gap.value;
  const Real kappa = 1 - Real(rig.sheet.refraction_shape);
  if (std::isinf(eye.z)) {
    const Real way = std::sqrt(1 + kappa * (eye.x * eye.x + eye.y * eye.y));
    return {gap * eye.x / way, gap * eye.y / way};
  }
  const Point r{eye.x - lens_point.x, eye.y - lens_point.y};
  const Real way = std::sqrt(eye.z * eye.z + kappa * (r.x * r.x + r.y * r.y));
  return {gap * r.x / way, gap * r.y / way};
}

/// Returns the lens point through which the eye sees the panel point: L = Q + Delta(L, E). Delta
/// points from the panel point toward the eye's projection; its length grows with the remaining
/// distance.
Point lens_point(const optics::Rig& rig, Point q, const OracleEye& eye) {
  if (std::isinf(eye.z)) {
    const Point delta = shift(rig, q, eye);
    return {q.x + delta.x, q.y + delta.y};
  }
  // Distant eyes: iterate L until it no longer changes.
  Point l = q;
  for (int round = 0; round < 40; ++round) {
    const Point delta = shift(rig, l, eye);
    const Point next{q.x + delta.x, q.y + delta.y};
    const Real moved = std::fabs(next.x - l.x) + std::fabs(next.y - l.y);
    l = next;
    if (moved <= 1e-18L * (std::fabs(l.x) + std::fabs(l.y))) return l;
  }
  // Otherwise bisect: L = Q + part (E - Q).
  const Point way{eye.x - q.x, eye.y - q.y};
  const Real length = std::sqrt(way.x * way.x + way.y * way.y);
  Real low = 0, high = 1;
  for (int step = 0; step < 80; ++step) {
    const Real part = low + (high - low) / 2;
    const Point delta = shift(rig, {q.x + part * way.x, q.y + part * way.y}, eye);
    const bool beyond = part * length > std::sqrt(delta.x * delta.x + delta.y * delta.y);
    (beyond ? high : low) = part;
  }
  return {q.x + low * way.x, q.y + low * way.y};
}

}  // namespace

OraclePlace oracle_place(Real phase) {
  // A phase less than 2^-32 below a border counts as on the border.
  const Real tolerance = 1 / Real(4294967296.0);
  const Real lens = std::floor(phase + Real(0.5) + tolerance);
  return {static_cast<int64_t>(lens), phase - lens};
}

Real oracle_lens_at(const optics::Rig& rig, Real x_mm, Real y_mm, int channel) {
  const Real offset = rig.sheet.channel_offset[static_cast<size_t>(channel)].value;
  const Real x_px = x_mm / Real(rig.panel.pixel_width.value) + offset / 3;
  const Real down_px = -y_mm / Real(rig.panel.pixel_height.value);
  return 3 * (x_px + Real(rig.sheet.slant) * down_px) / Real(rig.sheet.pitch.value) +
         Real(rig.sheet.offset.value);
}

Real oracle_phase(const optics::Rig& rig, int i, int j, int channel, const OracleEye& eye) {
  const Point l = lens_point(rig, panel_point(rig, i, j, channel), eye);
  return oracle_lens_at(rig, l.x, l.y, channel);
}

OracleEye oracle_design_eye(const optics::Rig& rig) {
  const Real z = rig.viewing.distance.value;
  if (std::isinf(z)) return {0, 0, z};
  return {Real(rig.viewing.centre.value), Real(rig.viewing.height.value), z};
}

OracleRay oracle_ray(const optics::Rig& rig, int i, int j, int channel, int64_t lens) {
  OracleEye eye = oracle_design_eye(rig);
  const auto beyond = [&](Real x) {
    return oracle_phase(rig, i, j, channel, {x, eye.y, eye.z}) >= static_cast<Real>(lens);
  };
  // The phase grows with the eye's x: widen the interval until it contains the lens, then bisect.
  Real low = std::isinf(eye.z) ? Real(-0.01) : -eye.z / 100;
  Real high = -low;
  while (beyond(low)) low *= 2;
  while (!beyond(high)) high *= 2;
  for (int step = 0; step < 64; ++step) {
    const Real middle = low + (high - low) / 2;
    (beyond(middle) ? high : low) = middle;
  }
  eye.x = high;
  const Point l = lens_point(rig, panel_point(rig, i, j, channel), eye);
  return {l.x, std::isinf(eye.z) ? eye.x : (eye.x - l.x) / eye.z};
}

namespace {

using Real3 = Vec3T<Real>;

struct OracleLine {
  Real3 from;
  Real3 way;  ///< direction, of any length
};

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

/// Tracer tests every ray against every primitive. It supports glowing, mirroring and transparent
/// materials, and neither lights nor ambient light. Mirrored and refracted rays start at a distance
/// of `start_off` from their surfaces.
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

constexpr int kDepth = 5;              // the default of renders
constexpr double kHair = 2e-5;         // mm
constexpr Real kMostStartOff = 5e-5L;  // mm: 2^-20 of (largest coordinate + radius), 50 mm
/// Fraction of the viewing distance: rays start no nearer to the eye.
constexpr Real kNearest = 0.99L;

struct Move {
  Real x = 0;
  Real y = 0;
};

/// Returns the line of a subpixel from in front of the panel into it; heights are paraxial by
/// definition.
OracleLine line_of(const optics::Rig& rig, int i, int j, int channel, Move move) {
  const OracleEye eye = oracle_design_eye(rig);
  const OraclePlace at = oracle_place(oracle_phase(rig, i, j, channel, eye));
  const OracleRay ray = oracle_ray(rig, i, j, channel, at.lens);
  const Real q = Real(rig.panel.pixel_height.value) *
                 (Real(rig.panel.height_px) / 2 -
                  (Real(j) + Real(rig.panel.layout.offset(i, j, channel).y_px)));
  const Real y = (q * eye.z + Real(rig.sheet.gap.value) * eye.y) / (eye.z + rig.sheet.gap.value);
  const Real tan_y = (eye.y - y) / eye.z;
  const Real start = kNearest * eye.z;
  return {{ray.lens_x_mm + move.x + start * ray.tan_x, y + move.y + start * tan_y, start},
          {-ray.tan_x, -tan_y, -1}};
}

Real code_of(const render::SceneDescription& scene, const OracleLine& line, int channel,
             Real start_off) {
  return 255 * std::clamp(Tracer{scene, channel, kDepth, start_off}.light(line, 0, 0, {}), Real(0),
                          Real(1));
}

enum class OracleVerdict {
  Same,        ///< equal within one code
  BesideOnly,  ///< equal for a slightly moved ray, or with the renderer's start offset for later
               ///< rays
  Different,
};

struct SubpixelCode {
  int i, j, channel;
  uint8_t code;
};

/// Evaluates the oracle for one subpixel of the scene under plain_stage().
OracleVerdict ask_oracle(const render::SceneDescription& scene, const optics::Rig& rig,
                         SubpixelCode shown) {
  const Real hair = kHair;
  const auto same = [&](Move move, Real start_off = 0) {
    const OracleLine line = line_of(rig, shown.i, shown.j, shown.channel, move);
    return std::fabs(code_of(scene, line, shown.channel, start_off) - Real(shown.code)) <= 1;
  };
  if (same({})) return OracleVerdict::Same;
  for (const Move move : std::array<Move, 4>{{{hair, 0}, {-hair, 0}, {0, hair}, {0, -hair}}})
    if (same(move)) return OracleVerdict::BesideOnly;
  // Later rays may graze outlines too, and the renderer's rays start slightly off their surfaces.
  for (const Real start_off : {kMostStartOff / 4, kMostStartOff / 2, kMostStartOff})
    if (same({}, start_off)) return OracleVerdict::BesideOnly;
  return OracleVerdict::Different;
}

}  // namespace

StabilityRow compare_with_oracle(const render::SceneDescription& scene, const optics::Rig& rig,
                                 const StabilitySize& size) {
  const frames::WovenFrame frame = render_small(scene, plain_stage(), rig, size.threads);
  std::atomic<uint64_t> beside{0};
  const Tally tally =
      tally_parts(size, static_cast<uint64_t>(rig.panel.height_px), [&](uint64_t row, Tally& part) {
        const int j = static_cast<int>(row);
        for (int s = 0; s < 3 * rig.panel.width_px; ++s) {
          const OracleVerdict verdict = ask_oracle(scene, rig, {s / 3, j, s % 3, frame.row(j)[s]});
          part.check(verdict != OracleVerdict::Different);
          if (verdict == OracleVerdict::BesideOnly) ++beside;
        }
      });
  return {.tally = tally, .note = fmt::format("{} lie on an outline", beside.load())};
}
}  // namespace lenticule::lab
