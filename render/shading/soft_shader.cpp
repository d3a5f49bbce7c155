// SPDX-License-Identifier: Apache-2.0
#include "render/shading/soft_shader.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "render/accel/ray_stream.h"
#include "render/rays/primary_packets.h"
#include "render/shading/shading_tables.h"

namespace lenticule::render::sampling {
namespace {

/// 2^32 divided by the golden ratio: far from every simple pattern.
constexpr uint32_t kGolden = 0x9e3779b9U;

}  // namespace

uint32_t mixed(uint32_t bits) {
  bits ^= bits >> 16;
  bits *= 0x7feb352dU;
  bits ^= bits >> 15;
  bits *= 0x846ca68bU;
  return bits ^ bits >> 16;
}

uint32_t subpixel_seed(int row, int subpixel, int sample) {
  const uint32_t in_row = mixed(static_cast<uint32_t>(row) + kGolden);
  const uint32_t in_panel = mixed(in_row + static_cast<uint32_t>(subpixel));
  return mixed(in_panel + static_cast<uint32_t>(sample));
}

uint32_t longer_path(uint32_t path, Turn turn) {
  return mixed(path * kGolden + static_cast<uint32_t>(turn));
}

SampleSet sample_set(std::span<const uint32_t, 16> seeds, uint32_t path, uint32_t use) {
  const uint32_t key = mixed(path + use * kGolden);
  SampleSet set;
  for (size_t r = 0; r < 16; ++r) {
    set.scramble[0][r] = mixed(seeds[r] ^ key);
    set.scramble[1][r] = mixed(set.scramble[0][r] + kGolden);
  }
  return set;
}

Sample sample_of(const SampleSet& set, uint32_t index) {
  // Row k of Pascal's triangle modulo 2 corresponds to bit k of the index.
  uint32_t second = 0;
  for (uint32_t left = index, row = 1; left != 0; left >>= 1, row ^= row << 1)
    if ((left & 1) != 0) second ^= row;
  return {&set, index, second};
}

}  // namespace lenticule::render::sampling

namespace lenticule::render {
namespace {

// ---- soft shader

/// Number of samples that cover all quarters of a disc: if the whole area light would shine on a
/// point, one of them would.
constexpr int kFewSamples = 4;

/// Largest spread of samples, in multiples of the noticeable light, at which a share is
/// interpolated.
constexpr float kMostApart = 8.0F;

}  // namespace

SoftShader::SoftShader(const SoftLight& options, Isa isa)
    : options_(options),
      kernel_(shading_kernel_for(isa)),
      sun_tangent_(
          static_cast<float>(std::tan(options.sun_radius_degrees * std::numbers::pi / 180.0))) {
  init_packets({&rays_, 1});
}

float SoftShader::radius(const shading_kernel::Light& area_light) const {
  if (options_.shadow_samples == 0) return 0.0F;
  // A scene unit is a millimetre on the panel.
  return area_light.kind == shading_kernel::Light::kDirectional
             ? sun_tangent_
             : static_cast<float>(options_.light_radius_mm);
}

bool SoftShader::looks_around() const {
  return options_.occlusion_samples > 0 && std::isfinite(options_.occlusion_distance_mm);
}

SoftSizes SoftShader::sizes() const {
  SoftSizes sizes;
  if (samples_area_lights())
    sizes = {.light_radius = options_.light_radius_mm, .sun_tangent = double{sun_tangent_}};
  if (looks_around()) sizes.around = options_.occlusion_distance_mm;
  return sizes;
}

shading_kernel::NewRays SoftShader::into_rays() {
  shading_kernel::NewRays rays;
  rays.packet = &rays_.rays.ray.org_x[0];
  rays.valid = rays_.valid;
  return rays;
}

uint32_t SoftShader::unblocked(const Scene& scene, Coherence coherence, WorkClock& clock) {
  const uint32_t traced = lane_bits(rays_.valid);
  if (traced == 0) return 0;
  clock.turn_to(Work::TraceShadows);
  occluded16(rays_.valid, scene.embree, rays_.rays.ray, coherence);
  clock.turn_to(Work::Shade);
  uint32_t free = 0;
  for (uint32_t r = 0; r < kPacket; ++r)
    free |= static_cast<uint32_t>(rays_.rays.ray.tfar[r] >= 0.0F) << r;
  return free & traced;
}

/// Returns the number of samples. The error of N samples is proportional to N^-3/4 times the light,
/// so weaker light needs fewer. Light of kMuch takes all requested samples if one code value is
/// noticeable; the error of sixteen samples is then three quarters of a code value.
uint32_t SoftShader::samples_for(float light, float noticed, int asked) const {
  constexpr float kMuch = 0.15F, kCode = 1.0F / 255;
  constexpr float kHalvesSamples = 0.5946F;  // 2^-3/4
  int samples = asked * factor_;
  float enough = kMuch / kCode * noticed * kHalvesSamples;
  for (; light <= enough && samples / 2 >= kFewSamples; enough *= kHalvesSamples) samples /= 2;
  return static_cast<uint32_t>(samples);
}

void KnownShare::set(uint32_t of_lanes, float value) {
  std::array<float, kPacket> values;
  values.fill(value);
  set(of_lanes, values);
}

void KnownShare::set(uint32_t of_lanes, std::span<const float, kPacket> values) {
  lanes |= of_lanes;
  for (size_t r = 0; r < kPacket; ++r) {
    const bool is_known = (of_lanes & kLaneBit[r]) != 0;
    share[r] = is_known ? values[r] : share[r];
    apart[r] = is_known ? 0.0F : apart[r];
  }
}

AreaLightSeen SoftShader::add_area_light(const SoftPacket& packet, size_t area_light,
                                         KnownLanes culled, const KnownShare& shares,
                                         const float* weight, float* light, WorkClock& clock) {
  if (integrates_)
    return integrate_area_light(packet, area_light, culled, shares, weight, light, clock);
  const AreaLightSamples all{.count = static_cast<uint32_t>(options_.shadow_samples * factor_),
                             .weight = weight,
                             .added = kAllLanes};
  return sample_area_light(packet, area_light, all, culled, light, clock);
}

/// Integrates an area light. If the whole light would shine on a point, the result is the integral
/// times the visible share. A culling result gives the same share as traced rays, so that no byte
/// depends on which shafts happen to be culled. If a part of the light is below the horizon, the
/// unknown light is the sum of the samples.
AreaLightSeen SoftShader::integrate_area_light(const SoftPacket& packet, size_t area_light,
                                               KnownLanes culled, const KnownShare& shares,
                                               const float* weight, float* light,
                                               WorkClock& clock) {
  const shading_kernel::Light& shape = packet.scene.shading->lights()[area_light];
  alignas(64) std::array<float, kPacket> brings, of_sampled;
  const shading_kernel::AreaLightLanes shines =
      kernel_.whole_area_light(shape, radius(shape), packet.surfaces, weight, brings.data());
  const uint32_t resolved = agreeing(shares, brings.data(), packet.noticed);
  const uint32_t partly = shines.partly & ~resolved;
  const uint32_t wanted = partly | (shines.whole & ~resolved);
  const uint32_t sampled = partly | (wanted & ~(culled.lit | culled.blocked));
  AreaLightSeen seen;
  if (sampled != 0) {
    float most = 0.0F;
    for (size_t r = 0; r < kPacket; ++r) {
      of_sampled[r] = (sampled & kLaneBit[r]) != 0 ? weight[r] : 0.0F;
      most = std::max(most, (wanted & kLaneBit[r]) != 0 ? brings[r] : 0.0F);
    }
    const uint32_t enough = samples_for(most, packet.noticed, options_.shadow_samples);
    const AreaLightSamples some{.count = std::max(enough, uint32_t{kFewSamples}),
                                .weight = of_sampled.data(),
                                .added = partly};
    seen = sample_area_light(packet, area_light, some, culled, light, clock);
  }
  seen.share.set(resolved, shares.share);
  const uint32_t of_culling = wanted & ~sampled;
  seen.share.set(culled.lit & of_culling, 1.0F);
  seen.share.set(culled.blocked & of_culling, 0.0F);
  seen.share.lanes &= shines.whole | shines.partly;
  add_shares(seen, seen.share.lanes & ~partly, brings.data(), light);
  const uint32_t unsampled = seen.share.lanes & ~sampled;
  count_known({.lit = unsampled & ~seen.none, .blocked = unsampled & seen.none});
  return seen;
}

/// Returns the lanes whose shares were interpolated from values that differ little.
uint32_t SoftShader::agreeing(const KnownShare& shares, const float* brings, float noticed) {
  const float most = kMostApart * noticed;
  uint32_t lanes = 0;
  for (size_t r = 0; r < kPacket; ++r)
    lanes |= shares.apart[r] * brings[r] <= most ? shares.lanes & kLaneBit[r] : 0;
  return lanes;
}

/// Adds the shares of the given lanes; also finds the lanes in which all or none of the light is
/// visible.
void SoftShader::add_shares(AreaLightSeen& seen, uint32_t lanes, const float* brings,
                            float* light) {
  for (size_t r = 0; r < kPacket; ++r) {
    const uint32_t bit = lanes & kLaneBit[r];
    const float share = seen.share.share[r];
    light[r] += bit != 0 ? share * brings[r] : 0.0F;
    seen.all |= share == 1.0F ? bit : 0;
    seen.none |= share == 0.0F ? bit : 0;
  }
}

void SoftShader::count_known(KnownLanes known) {
  const auto rays = [&](uint32_t lanes) {
    return static_cast<uint64_t>(options_.shadow_samples * factor_) *
           static_cast<uint64_t>(std::popcount(lanes));
  };
  counts_.shadow_rays += rays(known.lit | known.blocked);
  counts_.shadow_rays_culled += rays(known.lit);
  counts_.shadow_rays_blocked += rays(known.blocked);
}

AreaLightSeen SoftShader::sample_area_light(const SoftPacket& packet, size_t area_light,
                                            const AreaLightSamples& asked, KnownLanes known,
                                            float* light, WorkClock& clock) {
  const shading_kernel::Light& shape = packet.scene.shading->lights()[area_light];
  alignas(64) std::array<float, kPacket> part;
  alignas(64) std::array<float, kPacket> arriving{}, arrived{};
  for (size_t r = 0; r < kPacket; ++r) part[r] = asked.weight[r] / static_cast<float>(asked.count);
  const sampling::SampleSet set =
      sampling::sample_set(packet.seeds, packet.path, sampling::use_of_light(area_light));
  shading_kernel::NewRays rays = into_rays();
  uint32_t ever_wanted = 0, ever_seen = 0, ever_hidden = 0;
  for (uint32_t i = 0; i < asked.count; ++i) {
    const bool any = kernel_.area_light_rays(shape, radius(shape), sampling::sample_of(set, i),
                                             packet.surfaces, part.data(), rays);
    counts_.invalid_rays += static_cast<uint64_t>(rays.refused);
    if (!any) continue;
    const uint32_t wanted = lane_bits(rays_.valid);
    const Coherence coherence = coherence_of(rays_.valid, rays_.rays.ray);
    const uint32_t seen = resolve(known) | unblocked(packet.scene, coherence, clock);
    ever_wanted |= wanted;
    ever_seen |= seen;
    ever_hidden |= wanted & ~seen;
    for (size_t r = 0; r < kPacket; ++r) {
      const float brought = (seen & kLaneBit[r]) != 0 ? rays.weight[r] : 0.0F;
      light[r] += (asked.added & kLaneBit[r]) != 0 ? brought : 0.0F;
      arrived[r] += brought;
      arriving[r] += (wanted & kLaneBit[r]) != 0 ? rays.weight[r] : 0.0F;
    }
  }
  for (size_t r = 0; r < kPacket; ++r)
    if (arriving[r] != 0.0F) arrived[r] /= arriving[r];
  AreaLightSeen seen{.all = ever_wanted & ~ever_hidden, .none = ever_wanted & ~ever_seen};
  seen.share.set(ever_wanted, arrived);
  return seen;
}

/// Disables rays to an area light whose visibility is known; returns the lanes whose rays reach the
/// light.
uint32_t SoftShader::resolve(KnownLanes known) {
  const uint32_t wanted = lane_bits(rays_.valid);
  const uint32_t lit = known.lit & wanted;
  const uint32_t blocked = known.blocked & wanted;
  counts_.shadow_rays += static_cast<uint64_t>(std::popcount(wanted));
  counts_.shadow_rays_culled += static_cast<uint64_t>(std::popcount(lit));
  counts_.shadow_rays_blocked += static_cast<uint64_t>(std::popcount(blocked));
  take_lanes(lit | blocked, rays_.valid);
  return lit;
}

/// Adds the light of an environment picture or sky in the directions of rays_.
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

SoftShader::Around SoftShader::look_around(const SoftPacket& packet, uint32_t samples,
                                           uint32_t open, WorkClock& clock) {
  const bool pictured = lit_by_surroundings() && !packet.scene.backdrop.flat();
  const float far = lit_by_surroundings() ? std::numeric_limits<float>::infinity()
                                          : static_cast<float>(options_.occlusion_distance_mm);
  const sampling::SampleSet set =
      sampling::sample_set(packet.seeds, packet.path, sampling::kUseAmbient);
  shading_kernel::NewRays rays = into_rays();
  Around around;
  for (uint32_t i = 0; i < samples; ++i) {
    kernel_.ambient_rays(far, sampling::sample_of(set, i), packet.surfaces, rays);
    counts_.invalid_rays += static_cast<uint64_t>(rays.refused);
    const uint32_t wanted = lane_bits(rays_.valid);
    const uint32_t known = open & wanted;
    around.lanes |= wanted;
    // All samples need the same lanes, so one that has nothing to trace stands for all.
    const uint32_t of_known = known == wanted ? samples : 1;
    counts_.ambient_rays += uint64_t{of_known} * static_cast<uint64_t>(std::popcount(wanted));
    counts_.ambient_rays_culled += uint64_t{of_known} * static_cast<uint64_t>(std::popcount(known));
    take_lanes(known, rays_.valid);
    const uint32_t traced = unblocked(packet.scene, Coherence::Incoherent, clock);
    for (size_t r = 0; r < kPacket; ++r)
      around.open[r] += (known >> r & 1) * of_known + (traced >> r & 1);
    if (pictured) add_surroundings(packet, traced, around.light);
    if (known == wanted) break;
  }
  return around;
}

void SoftShader::find_ambient(const SoftPacket& packet, uint32_t open, const KnownShare& known,
                              const float* weight, const float* backdrop, float* ambient,
                              WorkClock& clock) {
  const bool is_share = shares(packet.scene);
  const uint32_t resolved = is_share ? known.lanes : 0;
  const float* const flat_ambient = packet.scene.shading->tables().ambient;
  const float brightest =
      lit_by_surroundings() ? 1.0F : *std::max_element(flat_ambient, flat_ambient + 3);
  const uint32_t samples = samples_for(brightest * *std::max_element(weight, weight + kPacket),
                                       packet.noticed, ambient_samples());
  const Around around = look_around(packet, samples, open | resolved, clock);
  share_.lanes = around.lanes;
  for (size_t r = 0; r < kPacket; ++r) {
    share_.share[r] = (resolved >> r & 1) != 0
                          ? known.share[r]
                          : static_cast<float>(around.open[r]) / static_cast<float>(samples);
    const auto channel = static_cast<size_t>(packet.surfaces.channel[r]);
    ambient[r] =
        is_share ? share_.share[r] * (lit_by_surroundings() ? backdrop[r] : flat_ambient[channel])
                 : static_cast<float>(around.light[r] / samples);
  }
}

}  // namespace lenticule::render
