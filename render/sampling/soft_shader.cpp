// SPDX-License-Identifier: Apache-2.0
#include "render/sampling/soft_shader.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "render/lane_masks.h"
#include "render/primary_packets.h"
#include "render/shading_tables.h"

namespace lenticule::render {

SoftShader::SoftShader(const SoftLight& options, Isa isa)
    : options_(options),
      kernel_(shading_kernel_for(isa)),
      sun_tangent_(
          static_cast<float>(std::tan(options.sun_radius_degrees * std::numbers::pi / 180.0))) {
  init_packets({&rays_, 1});
}

float SoftShader::radius(const shading_kernel::Light& lamp) const {
  if (options_.shadow_samples == 0) return 0.0F;
  // A scene unit is a millimetre on the glass.
  return lamp.kind == shading_kernel::Light::kDirectional
             ? sun_tangent_
             : static_cast<float>(options_.lamp_radius_mm);
}

LampSizes SoftShader::sizes() const {
  if (options_.shadow_samples == 0) return {};
  return {.radius = options_.lamp_radius_mm, .sun_tangent = double{sun_tangent_}};
}

uint32_t SoftShader::unblocked(const Scene::Impl& scene, Coherence coherence, WorkClock& clock) {
  const uint32_t traced = lane_bits(rays_.valid);
  if (traced == 0) return 0;
  clock.turn_to(Work::TraceShadows);
  occluded16(rays_.valid, scene.embree.get(), rays_.rays.ray, coherence);
  clock.turn_to(Work::Shade);
  uint32_t free = 0;
  for (uint32_t r = 0; r < kPacket; ++r)
    free |= static_cast<uint32_t>(rays_.rays.ray.tfar[r] >= 0.0F) << r;
  return free & traced;
}

void SoftShader::add_lamp(const SoftPacket& packet, size_t lamp, KnownLanes known,
                          const float* weight, float* light, WorkClock& clock) {
  const shading_kernel::Light& shape = packet.scene.shading->lights()[lamp];
  const int count = options_.shadow_samples * factor_;
  alignas(64) std::array<float, kPacket> part;
  for (size_t r = 0; r < kPacket; ++r) part[r] = weight[r] / static_cast<float>(count);
  const sampling::SampleSet set =
      sampling::sample_set(packet.seeds, packet.path, sampling::use_of_light(lamp));
  new_rays_.packet = &rays_.rays.ray.org_x[0];
  new_rays_.valid = rays_.valid;
  for (int i = 0; i < count; ++i) {
    const bool any =
        kernel_.lamp_rays(shape, radius(shape), sampling::sample_of(set, static_cast<uint32_t>(i)),
                          packet.surfaces, part.data(), new_rays_);
    counts_.invalid += static_cast<uint64_t>(new_rays_.refused);
    if (!any) continue;
    const uint32_t wanted = lane_bits(rays_.valid);
    const uint32_t lit = known.lit & wanted;
    const uint32_t blocked = known.blocked & wanted;
    counts_.shadow += static_cast<uint64_t>(std::popcount(wanted));
    counts_.shadow_proved += static_cast<uint64_t>(std::popcount(lit));
    counts_.shadow_blocked += static_cast<uint64_t>(std::popcount(blocked));
    take_lanes(lit | blocked, rays_.valid);
    const uint32_t seen = lit | unblocked(packet.scene, Coherence::Coherent, clock);
    for (uint32_t r = 0; r < kPacket; ++r)
      light[r] += (seen >> r & 1) != 0 ? new_rays_.weight[r] : 0.0F;
  }
}

/// A picture of the surroundings, or a sky, in the directions of rays_.
void SoftShader::add_surroundings(const SoftPacket& packet, uint32_t lanes,
                                  std::span<double, kPacket> sum) {
  const RTCRay16& ray = rays_.rays.ray;
  for (uint32_t left = lanes; left != 0; left &= left - 1) {
    const auto r = static_cast<size_t>(std::countr_zero(left));
    const Vec3 direction{double{ray.dir_x[r]}, double{ray.dir_y[r]}, double{ray.dir_z[r]}};
    sum[r] +=
        backdrop_light(packet.scene.backdrop, normalized(direction), packet.surfaces.channel[r]);
  }
}

void SoftShader::find_ambient(const SoftPacket& packet, const float* backdrop, float* ambient,
                              WorkClock& clock) {
  const bool surroundings = options_.environment_samples > 0;
  const bool pictured = surroundings && !packet.scene.backdrop.flat();
  const float* const flat_ambient = packet.scene.shading->tables().ambient;
  const float far = surroundings ? std::numeric_limits<float>::infinity()
                                 : static_cast<float>(options_.occlusion_distance_mm);
  const int samples = ambient_samples() * factor_;
  const sampling::SampleSet set =
      sampling::sample_set(packet.seeds, packet.path, sampling::kUseAmbient);
  new_rays_.packet = &rays_.rays.ray.org_x[0];
  new_rays_.valid = rays_.valid;
  std::array<int, kPacket> open{};
  std::array<double, kPacket> sum{};
  for (int i = 0; i < samples; ++i) {
    const bool any = kernel_.ambient_rays(far, sampling::sample_of(set, static_cast<uint32_t>(i)),
                                          packet.surfaces, new_rays_);
    counts_.invalid += static_cast<uint64_t>(new_rays_.refused);
    if (!any) break;  // where there is nothing diffuse, no sample finds any
    counts_.ambient += count_lanes(rays_.valid);
    const uint32_t free = unblocked(packet.scene, Coherence::Incoherent, clock);
    for (size_t r = 0; r < kPacket; ++r) open[r] += static_cast<int>(free >> r & 1);
    if (pictured) add_surroundings(packet, free, sum);
  }
  for (size_t r = 0; r < kPacket; ++r) {
    const float part = static_cast<float>(open[r]) / static_cast<float>(samples);
    const auto channel = static_cast<size_t>(packet.surfaces.channel[r]);
    ambient[r] = pictured ? static_cast<float>(sum[r] / samples)
                          : part * (surroundings ? backdrop[r] : flat_ambient[channel]);
  }
}

}  // namespace lenticule::render
