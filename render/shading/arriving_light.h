// SPDX-License-Identifier: Apache-2.0
// The light that arrives at the lanes of a packet, and rays toward it, for the shading kernels of
// one instruction set.
#pragma once

#include "render/shading/met_primitives.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

/// Fraction of the distance to a light within which an occluder counts as the light itself.
constexpr float kLightClearance = 1.0F / (1 << 18);
/// Embree aborts the process on some numbers beyond this limit.
constexpr float kEmbreeLimit = 1e18F;

/// Direction and distance of a light, and the light that arrives if unoccluded.
struct Arrival {
  Floats3 toward;
  Floats distance, intensity;
};

/// Returns the vector from `start` to a light's centre; unit if the light is directional.
inline Floats3 way_to(const Light& light, const Floats3& start) {
  if (light.kind == Light::kDirectional) return Floats3{} - spread(light.direction);
  return spread(light.position) - start;
}

/// `intensity` is that of the light itself.
inline Arrival arrival(const Light& light, const Floats3& way, const Floats& intensity) {
  Arrival at{};
  at.intensity = intensity;
  if (light.kind == Light::kDirectional) {
    at.toward = way;
    at.distance = Floats::of(__builtin_inff());
    return at;
  }
  const Floats squared = dot(way, way);
  at.distance = root(squared);
  const Masks apart = at.distance > 0.0F;
  at.toward = way * select(apart, 1.0F / at.distance, Floats{});
  at.intensity = select(apart, at.intensity, Floats{});
  if (light.kind == Light::kSpot) {
    const Floats inside = Floats{} - dot(spread(light.direction), at.toward) - light.cos_outer;
    const Floats part = light.cos_width > 0.0F ? clamp01(inside / light.cos_width)
                                               : select(inside >= 0.0F, Floats::of(1.0F), Floats{});
    at.intensity = at.intensity * (part * part);
  }
  if (light.falls_off)
    at.intensity = select(apart, at.intensity * (light.world_units_squared / squared), Floats{});
  return at;
}

/// Returns false for NaN.
inline Masks within_limits(const Floats3& v) {
  return (absolute(v.x) < kEmbreeLimit) & (absolute(v.y) < kEmbreeLimit) &
         (absolute(v.z) < kEmbreeLimit);
}

/// Writes the rays of lanes that are `wanted` and valid for Embree, and harmless rays in the other
/// lanes.
inline bool write_rays(const Floats3& origin, const Floats3& direction, const Floats& far,
                       const Masks& wanted, NewRays& out) {
  const Masks fit = within_limits(origin) & within_limits(direction) & (far >= 0.0F) &
                    (dot(direction, direction) > 0.0F);
  const Masks valid = wanted & fit;
  out.refused = 0;
  const Masks refused = wanted & ~fit;
  if (any(refused))
    for (int r = 0; r < kLanes; ++r) out.refused -= refused[r];
  masks_at(out.valid) = valid;
  float* packet = out.packet;
  floats_at(packet + packet_kernel::kOriginX * kLanes) = select(valid, origin.x, Floats{});
  floats_at(packet + packet_kernel::kOriginY * kLanes) = select(valid, origin.y, Floats{});
  floats_at(packet + packet_kernel::kOriginZ * kLanes) = select(valid, origin.z, Floats{});
  floats_at(packet + packet_kernel::kDirectionX * kLanes) = select(valid, direction.x, Floats{});
  floats_at(packet + packet_kernel::kDirectionY * kLanes) = select(valid, direction.y, Floats{});
  floats_at(packet + packet_kernel::kDirectionZ * kLanes) =
      select(valid, direction.z, Floats::of(1.0F));
  floats_at(packet + packet_kernel::kTFar * kLanes) = select(valid, far, Floats{});
  return any(valid);
}

}  // namespace
}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
