// SPDX-License-Identifier: Apache-2.0
#include "tests/support/oracles/reference_renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "frames/srgb.h"
#include "tests/support/oracles/reference_sampling.h"

namespace lenticule::test {
namespace {

using render::Cone;
using render::Light;
using render::Material;
using render::SceneDescription;
using render::Sphere;
using render::Texture;
using render::TriangleMesh;

constexpr double kFar = std::numeric_limits<double>::infinity();

struct Line {
  Vec3 from;
  Vec3 way;  // unit vector
};

/// Identifies one primitive, so that a ray that starts on it does not hit it again, however large
/// it is.
struct Primitive {
  const void* list = nullptr;
  size_t index = 0;
  friend bool operator==(const Primitive&, const Primitive&) = default;
};

struct Meeting {
  double t = kFar;
  Vec3 outward{};       // geometric normal on the outer side
  Vec3 interpolated{};  // interpolated normal, or zero
  const Material* material = nullptr;
  Vec3 colour{};
  Primitive primitive{};
};

Vec3 mix(Vec3 a, Vec3 b, Vec3 c, double wa, double wb, double wc) {
  return a * wa + b * wb + c * wc;
}

Vec3 texel(const Texture& texture, long x, long y) {
  const auto place = [](long i, long size, bool repeat, bool mirror) {
    if (mirror) {
      const long in_pair = ((i % (2 * size)) + 2 * size) % (2 * size);
      return std::min(in_pair, 2 * size - 1 - in_pair);
    }
    if (repeat) return ((i % size) + size) % size;
    return std::min(std::max(i, 0L), size - 1);
  };
  const long column = place(x, texture.width, texture.repeat_u, texture.mirror_u);
  const long row = place(y, texture.height, texture.repeat_v, texture.mirror_v);
  const size_t texel = static_cast<size_t>(row * texture.width + column) * 4;
  if (!texture.codes.empty()) {
    const auto& linear = frames::linear_of_codes();
    const uint8_t* code = &texture.codes[texel];
    return {linear[code[0]], linear[code[1]], linear[code[2]]};
  }
  const float* rgba = &texture.rgba[texel];
  return {rgba[0], rgba[1], rgba[2]};
}

Vec3 bilinear(const Texture& texture, double u, double v) {
  if (!texture.repeat_u) u = std::min(std::max(u, 0.0), 1.0);
  if (!texture.repeat_v) v = std::min(std::max(v, 0.0), 1.0);
  const double x = u * texture.width - 0.5;
  const double y = v * texture.height - 0.5;
  const long left = std::lround(std::floor(x));
  const long top = std::lround(std::floor(y));
  const double fx = x - std::floor(x);
  const double fy = y - std::floor(y);
  return texel(texture, left, top) * ((1 - fx) * (1 - fy)) +
         texel(texture, left + 1, top) * (fx * (1 - fy)) +
         texel(texture, left, top + 1) * ((1 - fx) * fy) +
         texel(texture, left + 1, top + 1) * (fx * fy);
}

/// Computes the signed areas of the three corner triangles in the triangle's own plane.
void meet_triangle(const SceneDescription& scene, const TriangleMesh& mesh, size_t index,
                   const Line& line, double t_min, Meeting& nearest) {
  const auto [ia, ib, ic] = mesh.triangles[index];
  const Vec3 a = mesh.positions[ia];
  const Vec3 b = mesh.positions[ib];
  const Vec3 c = mesh.positions[ic];
  const Vec3 normal = cross(b - a, c - a);
  const double facing = dot(normal, line.way);
  if (facing == 0.0) return;
  const double t = dot(normal, a - line.from) / facing;
  if (!(t > t_min) || !(t < nearest.t)) return;
  const Vec3 p = line.from + line.way * t;
  const double area = dot(normal, normal);
  const double wa = dot(cross(b - p, c - p), normal) / area;
  const double wb = dot(cross(c - p, a - p), normal) / area;
  const double wc = dot(cross(a - p, b - p), normal) / area;
  if (wa < 0.0 || wb < 0.0 || wc < 0.0) return;
  nearest = {.t = t, .outward = normalized(normal)};
  nearest.material = &scene.materials[static_cast<size_t>(mesh.material)];
  nearest.colour = nearest.material->colour;
  nearest.primitive = {&mesh, index};
  if (!mesh.normals.empty())
    nearest.interpolated =
        normalized(mix(mesh.normals[ia], mesh.normals[ib], mesh.normals[ic], wa, wb, wc));
  if (nearest.material->texture >= 0 && !mesh.uvs.empty()) {
    const auto at = [&, ia = ia, ib = ib, ic = ic](size_t k) {
      return wa * mesh.uvs[ia][k] + wb * mesh.uvs[ib][k] + wc * mesh.uvs[ic][k];
    };
    const Texture& texture = *scene.textures[static_cast<size_t>(nearest.material->texture)];
    nearest.colour = nearest.colour * bilinear(texture, at(0), at(1));
  }
}

/// Returns the root that is not the line's start.
double other_root(double a, double b) { return std::abs(a) > std::abs(b) ? a : b; }

/// Uses the closest approach of the line to the centre.
void meet_sphere(const SceneDescription& scene, size_t index, const Line& line, double t_min,
                 bool starts_on_it, Meeting& nearest) {
  const Sphere& sphere = scene.spheres[index];
  const double middle = dot(sphere.centre - line.from, line.way);
  const Vec3 closest = line.from + line.way * middle - sphere.centre;
  const double half_chord_squared = sphere.radius * sphere.radius - dot(closest, closest);
  if (half_chord_squared < 0.0) return;
  const double half_chord = std::sqrt(half_chord_squared);
  for (const double t : {middle - half_chord, middle + half_chord}) {
    if (starts_on_it && t != other_root(middle - half_chord, middle + half_chord)) continue;
    if (!(t > t_min) || !(t < nearest.t)) continue;
    const Vec3 outward = normalized(line.from + line.way * t - sphere.centre);
    nearest = {.t = t, .outward = sphere.inward ? -outward : outward};
    nearest.material = &scene.materials[static_cast<size_t>(sphere.material)];
    nearest.primitive = {&scene.spheres, index};
    nearest.colour = nearest.material->colour;
  }
}

/// Uses coordinates whose z runs from base to apex: x^2 + y^2 = (r0 + k z)^2.
void meet_cone(const SceneDescription& scene, size_t index, const Line& line, double t_min,
               bool starts_on_it, Meeting& nearest) {
  const Cone& cone = scene.cones[index];
  const double height = length(cone.apex - cone.base);
  const Vec3 z = normalized(cone.apex - cone.base);
  const Vec3 x = normalized(cross(std::abs(z.x) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}, z));
  const Vec3 y = cross(z, x);
  const Vec3 o = line.from - cone.base;
  const Vec3 p{dot(o, x), dot(o, y), dot(o, z)};
  const Vec3 d{dot(line.way, x), dot(line.way, y), dot(line.way, z)};
  // Double precision loses the difference of the squares for large cones.
  using Real = long double;
  const double k = (cone.apex_radius - cone.base_radius) / height;
  const Real r = Real{cone.base_radius} + Real{k} * p.z;
  const Real a = Real{d.x} * d.x + Real{d.y} * d.y - Real{k} * k * d.z * d.z;
  const Real b = 2 * (Real{p.x} * d.x + Real{p.y} * d.y - k * r * d.z);
  const Real c = Real{p.x} * p.x + Real{p.y} * p.y - r * r;
  if (a == 0.0L || b * b - 4 * a * c < 0.0L) return;
  const Real root = std::sqrt(b * b - 4 * a * c);
  const auto first = static_cast<double>((-b - root) / (2 * a));
  const auto second = static_cast<double>((-b + root) / (2 * a));
  for (const double t : {first, second}) {
    if (starts_on_it && t != other_root(first, second)) continue;
    const Vec3 q = p + d * t;
    if (!(t > t_min) || !(t < nearest.t) || q.z < 0.0 || q.z > height) continue;
    const double radius = cone.base_radius + k * q.z;
    const Vec3 outward = normalized(x * q.x + y * q.y - z * (k * radius));
    nearest = {.t = t, .outward = cone.inward ? -outward : outward};
    nearest.material = &scene.materials[static_cast<size_t>(cone.material)];
    nearest.primitive = {&scene.cones, index};
    nearest.colour = nearest.material->colour;
  }
}

Meeting meet_all(const SceneDescription& scene, const Line& line, double t_min, Primitive except) {
  Meeting nearest;
  for (const TriangleMesh& mesh : scene.meshes)
    for (size_t k = 0; k < mesh.triangles.size(); ++k)
      if (!(Primitive{&mesh, k} == except)) meet_triangle(scene, mesh, k, line, t_min, nearest);
  for (size_t k = 0; k < scene.spheres.size(); ++k)
    meet_sphere(scene, k, line, t_min, Primitive{&scene.spheres, k} == except, nearest);
  for (size_t k = 0; k < scene.cones.size(); ++k)
    meet_cone(scene, k, line, t_min, Primitive{&scene.cones, k} == except, nearest);
  return nearest;
}

Vec3 ambient_of(const SceneDescription& scene) {
  if (scene.ambient) return *scene.ambient;
  return {0.12, 0.12, 0.12};
}

/// The subpixel whose ray is traced.
struct Subpixel {
  double world_per_mm = 1.0;
  uint32_t seed = 0;
};

/// A point from which light leaves toward the viewer, as its lights see it.
struct Place {
  Vec3 point;
  Vec3 facing;  // geometric normal
  Vec3 smooth;
  Vec3 view;
  Vec3 tint;
  const Meeting& at;
  uint32_t path;
};

class Tracer {
 public:
  Tracer(const SceneDescription& scene, const ReferenceOptions& options, const Subpixel& subpixel)
      : scene_(scene),
        max_depth_(options.max_depth),
        soft_(options.soft),
        subpixel_(subpixel),
        least_step_(1e-9 * subpixel.world_per_mm) {}

  Vec3 trace(const Line& line, double t_min, int depth, Primitive from, uint32_t path) const {
    const Meeting at = meet_all(scene_, line, t_min, from);
    if (at.t == kFar) return scene_.background;
    const Vec3 point = line.from + line.way * at.t;
    const bool outside = dot(at.outward, line.way) <= 0.0;
    const Vec3 facing = outside ? at.outward : -at.outward;
    Vec3 smooth = at.interpolated == Vec3{} ? facing : at.interpolated;
    if (dot(smooth, facing) < 0.0) smooth = -smooth;

    const Material& material = *at.material;
    const Vec3 tint = material.tinted_specular ? at.colour : Vec3{1, 1, 1};
    const Place place{point, facing, smooth, line.way, tint, at, path};
    Vec3 light = material.emission + ambient(place) * at.colour * material.diffuse;
    for (size_t k = 0; k < scene_.lights.size(); ++k)
      light += from_area_light(scene_.lights[k], static_cast<uint32_t>(1 + k), place);
    if (depth == max_depth_) return light;

    Vec3 mirror_weight = tint * material.specular;
    Vec3 through_weight = at.colour * material.transmittance;
    if (material.transmittance > 0.0) {
      const auto bent = bend(line.way, facing, smooth, material.refraction_index, outside);
      if (bent)
        light += through_weight * trace({point, *bent}, least_step_, depth + 1, at.primitive,
                                        reference_path(path, true));
      else
        mirror_weight += through_weight;
    }
    if (mirror_weight == Vec3{}) return light;
    Vec3 mirrored = line.way - smooth * (2 * dot(line.way, smooth));
    if (dot(mirrored, facing) <= 0.0) mirrored = line.way - facing * (2 * dot(line.way, facing));
    return light + mirror_weight * trace({point, normalized(mirrored)}, least_step_, depth + 1,
                                         at.primitive, reference_path(path, false));
  }

 private:
  /// Returns the light from the hemisphere.
  Vec3 ambient(const Place& place) const {
    const bool surroundings = soft_.environment_samples > 0;
    const int count = surroundings ? soft_.environment_samples : soft_.occlusion_samples;
    if (count == 0) return ambient_of(scene_);
    const double reach = surroundings ? kFar : soft_.occlusion_distance_mm * subpixel_.world_per_mm;
    int open = 0;
    for (int k = 0; k < count; ++k) {
      const SquarePoint at =
          reference_point(subpixel_.seed, place.path, 0, static_cast<uint32_t>(k));
      Vec3 way = reference_cosine_direction(at, place.smooth);
      // A direction below the surface is mirrored about it.
      if (dot(way, place.facing) < 0.0) way = way - place.facing * (2 * dot(way, place.facing));
      if (!(meet_all(scene_, {place.point, way}, least_step_, place.at.primitive).t < reach))
        ++open;
    }
    return (surroundings ? scene_.background : ambient_of(scene_)) * (double(open) / count);
  }

  /// Returns the mean of as many point lights as there are samples.
  Vec3 from_area_light(const Light& area_light, uint32_t use, const Place& place) const {
    const bool sun = area_light.kind == Light::Kind::Directional;
    const double size = sun ? std::tan(soft_.sun_radius_degrees * std::numbers::pi / 180.0)
                            : soft_.light_radius_mm * subpixel_.world_per_mm;
    const Vec3 middle = sun ? -normalized(area_light.direction) : area_light.position - place.point;
    const int count = size > 0.0 ? soft_.shadow_samples : 0;
    if (count == 0) return from_point(area_light, middle, place);
    Vec3 sum{};
    for (int k = 0; k < count; ++k) {
      const Vec3 on_disc = reference_on_disc(
          reference_point(subpixel_.seed, place.path, use, static_cast<uint32_t>(k)));
      const Vec3 aside = reference_turned(on_disc, normalized(middle));
      sum += from_point(area_light, middle + aside * size, place);
    }
    return sum / count;
  }

  Vec3 from_point(const Light& area_light, Vec3 whole_way, const Place& place) const {
    const bool sun = area_light.kind == Light::Kind::Directional;
    const Vec3 way = normalized(whole_way);
    const double distance = sun ? kFar : length(whole_way);
    if (dot(way, place.smooth) <= 0.0 || dot(way, place.facing) <= 0.0) return {};
    if (meet_all(scene_, {place.point, way}, least_step_, place.at.primitive).t < distance)
      return {};
    Vec3 arriving = area_light.colour;
    if (area_light.kind == Light::Kind::Spot) {
      const double cosine = dot(-way, normalized(area_light.direction));
      const double s =
          std::min(1.0, std::max(0.0, (cosine - area_light.cos_outer) /
                                          (area_light.cos_inner - area_light.cos_outer)));
      arriving = arriving * (s * s);
    }
    if (area_light.falls_off) arriving = arriving / (distance * distance);
    const Material& material = *place.at.material;
    const Vec3 bounced = place.smooth * (2 * dot(way, place.smooth)) - way;
    const double highlight =
        dot(bounced, -place.view) > 0.0 ? std::pow(dot(bounced, -place.view), material.shine) : 0.0;
    return arriving * (place.at.colour * (material.diffuse * dot(way, place.smooth)) +
                       place.tint * (material.specular * highlight));
  }

  static std::optional<Vec3> snell(Vec3 way, Vec3 normal, double ratio) {
    const double cosine = -dot(way, normal);
    const Vec3 along = (way + normal * cosine) * ratio;
    if (dot(along, along) > 1.0) return std::nullopt;
    return normalized(along - normal * std::sqrt(1.0 - dot(along, along)));
  }

  static std::optional<Vec3> bend(Vec3 way, Vec3 facing, Vec3 smooth, double index, bool outside) {
    const double ratio = outside ? 1.0 / index : index;
    if (dot(way, smooth) < 0.0) {
      const auto bent = snell(way, smooth, ratio);
      if (!bent || dot(*bent, facing) < 0.0) return bent;
    }
    return snell(way, facing, ratio);
  }

  const SceneDescription& scene_;
  int max_depth_;
  render::SoftLight soft_;
  Subpixel subpixel_;
  double least_step_;
};

}  // namespace

double reference_code(double light, bool colour_managed) {
  const double clipped = std::min(std::max(light, 0.0), 1.0);
  if (!colour_managed) return 255.0 * clipped;
  return 255.0 *
         (clipped <= 0.0031308 ? 12.92 * clipped : 1.055 * std::pow(clipped, 1 / 2.4) - 0.055);
}

double reference_light(const SceneDescription& scene, const render::Stage& stage,
                       const ReferenceLine& line, double start_mm, int channel,
                       const ReferenceOptions& options, uint32_t seed) {
  const Affine& world_from_panel = stage.world_from_panel;
  const Vec3 into_panel = world_from_panel.vector({-line.tan_x, -line.tan_y, -1.0});
  const Tracer tracer(scene, options,
                      {.world_per_mm = length(world_from_panel.column_x), .seed = seed});
  const Vec3 on_panel = world_from_panel.point({line.x_mm, line.y_mm, 0.0});
  const Vec3 colour = tracer.trace({on_panel, normalized(into_panel)},
                                   -start_mm * length(into_panel), 0, {}, kReferencePath);
  return channel == 0 ? colour.x : channel == 1 ? colour.y : colour.z;
}

double reference_subpixel(const SceneDescription& scene, const render::Stage& stage,
                          const optics::OpticalModel& model, int i, int j, int channel,
                          const ReferenceOptions& options) {
  const optics::SubpixelRay ray = model.ray(i, j, channel);
  // The line starts just before the eye and runs through the lens into the panel.
  const double start_mm =
      options.from_near_plane ? stage.near_mm : 0.99 * model.rig().viewing.distance.value;
  const double light =
      reference_light(scene, stage,
                      {.x_mm = ray.lens_x_mm + options.move_x_mm,
                       .y_mm = ray.lens_y_mm + options.move_y_mm,
                       .tan_x = ray.tan_x + options.move_tan,
                       .tan_y = ray.tan_y + options.move_tan},
                      start_mm, channel, options, reference_seed(j, 3 * i + channel, 0));
  return reference_code(light, scene.colour_managed);
}

}  // namespace lenticule::test
