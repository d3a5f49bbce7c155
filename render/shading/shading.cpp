// SPDX-License-Identifier: Apache-2.0
#include "render/shading/shading.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "render/scene/texture.h"

namespace lenticule::render {
namespace {

double spot_factor(const SceneLight& light, Vec3 toward_light) {
  const double cosine = -dot(light.direction, toward_light);
  const double width = light.cos_inner - light.cos_outer;
  if (!(width > 0.0)) return cosine >= light.cos_outer ? 1.0 : 0.0;
  const double inside = std::clamp((cosine - light.cos_outer) / width, 0.0, 1.0);
  return inside * inside;
}

Vec3 mirrored(Vec3 direction, Vec3 normal) {
  return direction - normal * (2.0 * dot(direction, normal));
}

/// Mirrors at the interpolated normal, or at the geometric normal if the interpolated one would
/// mirror the ray into its own surface.
Vec3 mirror_direction(const Surface& surface, Vec3 direction) {
  const Vec3 smooth = mirrored(direction, surface.shading_normal);
  return normalized(dot(smooth, surface.geometric_normal) > 0.0
                        ? smooth
                        : mirrored(direction, surface.geometric_normal));
}

std::optional<Vec3> transmit_direction(const Surface& surface, Vec3 direction) {
  const double index = surface.material->refraction_index;
  if (index == 1.0) return direction;
  const double eta = surface.outer_side ? 1.0 / index : index;
  if (dot(direction, surface.shading_normal) < 0.0) {
    const auto smooth = refracted(direction, surface.shading_normal, eta);
    if (!smooth || dot(*smooth, surface.geometric_normal) < 0.0) return smooth;
  }
  return refracted(direction, surface.geometric_normal, eta);
}

}  // namespace

std::optional<Vec3> refracted(Vec3 direction, Vec3 normal, double eta) {
  const double cosine = std::min(1.0, -dot(direction, normal));
  const double squared = 1.0 - eta * eta * (1.0 - cosine * cosine);
  // Rounding must not turn the critical angle into total reflection.
  if (squared < -4.0 * std::numeric_limits<double>::epsilon()) return std::nullopt;
  return normalized(direction * eta + normal * (eta * cosine - std::sqrt(std::max(0.0, squared))));
}

Arrival arrival(const SceneLight& light, Vec3 point, double units_per_world, int channel) {
  const double colour = component(light.colour, channel);
  if (light.kind == Light::Kind::Directional)
    return {-light.direction, std::numeric_limits<double>::infinity(), colour};
  const Vec3 way = light.position - point;
  const double distance = length(way);
  if (!(distance > 0.0)) return {};
  Arrival at{way / distance, distance, colour};
  if (light.kind == Light::Kind::Spot) at.intensity *= spot_factor(light, at.toward_light);
  if (light.falls_off) {
    const double world_distance = distance / units_per_world;
    at.intensity /= world_distance * world_distance;
  }
  return at;
}

double own_light(const Surface& surface, Vec3 ambient, int channel) {
  const Material& material = *surface.material;
  return component(material.emission, channel) +
         component(ambient, channel) * material.diffuse * surface.colour;
}

double reflected_light(const Surface& surface, Vec3 direction, const Arrival& light) {
  const double cosine = dot(surface.shading_normal, light.toward_light);
  if (!(cosine > 0.0) || !(dot(surface.geometric_normal, light.toward_light) > 0.0)) return 0.0;
  const Material& material = *surface.material;
  double reflectance = material.diffuse * surface.colour * cosine;
  if (material.specular > 0.0) {
    // Cosine between the light's mirror direction and the viewer: mirrored(-toward_light) .
    // -direction.
    const double along = dot(mirrored(light.toward_light, surface.shading_normal), direction);
    if (along > 0.0) {
      const double tint = material.tinted_specular ? surface.colour : 1.0;
      reflectance += material.specular * tint * std::pow(along, material.shine);
    }
  }
  return light.intensity * reflectance;
}

Continuation continuation(const Surface& surface, Vec3 direction) {
  const Material& material = *surface.material;
  Continuation on;
  on.mirror_weight = material.specular * (material.tinted_specular ? surface.colour : 1.0);
  const double through = material.transmittance * surface.colour;
  if (through > 0.0) {
    if (const auto bent = transmit_direction(surface, direction)) {
      on.transmit_weight = through;
      on.transmit_direction = *bent;
    } else {
      on.mirror_weight += through;
    }
  }
  if (on.mirror_weight > 0.0) on.mirror_direction = mirror_direction(surface, direction);
  return on;
}

}  // namespace lenticule::render
