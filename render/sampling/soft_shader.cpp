// SPDX-License-Identifier: Apache-2.0
#include "render/sampling/soft_shader.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "render/embree_packets.h"
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

bool SoftShader::looks_around() const {
  return options_.occlusion_samples > 0 && std::isfinite(options_.occlusion_distance_mm);
}

SoftSizes SoftShader::sizes() const {
  SoftSizes sizes;
  if (samples_lamps())
    sizes = {.lamp_radius = options_.lamp_radius_mm, .sun_tangent = double{sun_tangent_}};
  if (looks_around()) sizes.around = options_.occlusion_distance_mm;
  return sizes;
}

shading_kernel::NewRays SoftShader::into_rays() {
  shading_kernel::NewRays rays;
  rays.packet = &rays_.rays.ray.org_x[0];
  rays.valid = rays_.valid;
  return rays;
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

LampSeen SoftShader::add_lamp(const SoftPacket& packet, size_t lamp, KnownLanes known,
                              const float* weight, float* light, WorkClock& clock) {
  const shading_kernel::Light& shape = packet.scene.shading->lights()[lamp];
  const auto samples = static_cast<uint32_t>(options_.shadow_samples * factor_);
  alignas(64) std::array<float, kPacket> part;
  for (size_t r = 0; r < kPacket; ++r) part[r] = weight[r] / static_cast<float>(samples);
  const sampling::SampleSet set =
      sampling::sample_set(packet.seeds, packet.path, sampling::use_of_light(lamp));
  shading_kernel::NewRays rays = into_rays();
  uint32_t ever_wanted = 0, ever_seen = 0, ever_hidden = 0;
  for (uint32_t i = 0; i < samples; ++i) {
    const bool any = kernel_.lamp_rays(shape, radius(shape), sampling::sample_of(set, i),
                                       packet.surfaces, part.data(), rays);
    counts_.invalid += static_cast<uint64_t>(rays.refused);
    if (!any) continue;
    const uint32_t wanted = lane_bits(rays_.valid);
    const uint32_t seen = settle(known) | unblocked(packet.scene, Coherence::Coherent, clock);
    ever_wanted |= wanted;
    ever_seen |= seen;
    ever_hidden |= wanted & ~seen;
    for (uint32_t r = 0; r < kPacket; ++r) light[r] += (seen >> r & 1) != 0 ? rays.weight[r] : 0.0F;
  }
  return {
      .wanted = ever_wanted, .all = ever_wanted & ~ever_hidden, .none = ever_wanted & ~ever_seen};
}

/// Makes rays to a lamp invalid whose fate is known; returns those that reach it.
uint32_t SoftShader::settle(KnownLanes known) {
  const uint32_t wanted = lane_bits(rays_.valid);
  const uint32_t lit = known.lit & wanted;
  const uint32_t blocked = known.blocked & wanted;
  counts_.shadow += static_cast<uint64_t>(std::popcount(wanted));
  counts_.shadow_proved += static_cast<uint64_t>(std::popcount(lit));
  counts_.shadow_blocked += static_cast<uint64_t>(std::popcount(blocked));
  take_lanes(lit | blocked, rays_.valid);
  return lit;
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

SoftShader::Around SoftShader::look_around(const SoftPacket& packet, uint32_t open,
                                           WorkClock& clock) {
  const bool pictured = lit_by_surroundings() && !packet.scene.backdrop.flat();
  const float far = lit_by_surroundings() ? std::numeric_limits<float>::infinity()
                                          : static_cast<float>(options_.occlusion_distance_mm);
  const auto samples = static_cast<uint32_t>(ambient_samples());
  const sampling::SampleSet set =
      sampling::sample_set(packet.seeds, packet.path, sampling::kUseAmbient);
  shading_kernel::NewRays rays = into_rays();
  Around around;
  for (uint32_t i = 0; i < samples; ++i) {
    kernel_.ambient_rays(far, sampling::sample_of(set, i), packet.surfaces, rays);
    counts_.invalid += static_cast<uint64_t>(rays.refused);
    const uint32_t wanted = lane_bits(rays_.valid);
    const uint32_t known = open & wanted;
    // All samples want the same lanes: one that has nothing to trace speaks for the others.
    const uint32_t of_known = known == wanted ? samples : 1;
    counts_.ambient += uint64_t{of_known} * static_cast<uint64_t>(std::popcount(wanted));
    counts_.ambient_proved += uint64_t{of_known} * static_cast<uint64_t>(std::popcount(known));
    take_lanes(known, rays_.valid);
    const uint32_t traced = unblocked(packet.scene, Coherence::Incoherent, clock);
    for (size_t r = 0; r < kPacket; ++r)
      around.open[r] += (known >> r & 1) * of_known + (traced >> r & 1);
    if (pictured) add_surroundings(packet, traced, around.light);
    if (known == wanted) break;
  }
  return around;
}

void SoftShader::find_ambient(const SoftPacket& packet, uint32_t open, const KnownAround& known,
                              const float* backdrop, float* ambient, WorkClock& clock) {
  const bool is_share = shares(packet.scene);
  const uint32_t settled = is_share ? known.lanes : 0;
  const Around around = look_around(packet, open | settled, clock);
  const int samples = ambient_samples();
  const float* const flat_ambient = packet.scene.shading->tables().ambient;
  for (size_t r = 0; r < kPacket; ++r) {
    share_[r] = (settled >> r & 1) != 0
                    ? known.share[r]
                    : static_cast<float>(around.open[r]) / static_cast<float>(samples);
    const auto channel = static_cast<size_t>(packet.surfaces.channel[r]);
    ambient[r] = is_share
                     ? share_[r] * (lit_by_surroundings() ? backdrop[r] : flat_ambient[channel])
                     : static_cast<float>(around.light[r] / samples);
  }
}

}  // namespace lenticule::render
