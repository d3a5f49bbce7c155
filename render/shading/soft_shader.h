// SPDX-License-Identifier: Apache-2.0
// SoftShader computes the light on a packet's surfaces that is sampled with several rays per point:
// from area lights and from the hemisphere.
//
// The sample points are the first points of Sobol's two-dimensional sequence, with random
// digit scrambling (Owen) that differs between subpixels, bounces and uses. So the points of one
// subpixel are spread evenly, and the errors of two subpixels are uncorrelated.
//
// All computation is in integers, so the points are the same on every machine. Thread safety: all
// functions may be called from any thread.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>

#include "base/cpu.h"
#include "render/accel/ray_stream.h"
#include "render/culling/shaft.h"
#include "render/options/render_options.h"
#include "render/rays/primary_packets.h"
#include "render/scene/scene.h"
#include "render/shading/shading_kernel.h"
#include "render/shading/shading_tables.h"

namespace lenticule::render::sampling {

/// Returns a hash in which every input bit affects all bits.
[[nodiscard]] inline uint32_t mixed(uint32_t bits) {
  bits ^= bits >> 16;
  bits *= 0x7feb352dU;
  bits ^= bits >> 15;
  bits *= 0x846ca68bU;
  return bits ^ bits >> 16;
}

/// 2^32 divided by the golden ratio: far from every simple pattern.
inline constexpr uint32_t kGolden = 0x9e3779b9U;

/// Returns a seed that is specific to a subpixel. It does not contain the frame number, since still
/// pictures must not flicker. `sample` numbers the rays inside the subpixel
/// (RenderOptions::samples).
[[nodiscard]] inline uint32_t subpixel_seed(int row, int subpixel, int sample) {
  const uint32_t in_row = mixed(static_cast<uint32_t>(row) + kGolden);
  const uint32_t in_panel = mixed(in_row + static_cast<uint32_t>(subpixel));
  return mixed(in_panel + static_cast<uint32_t>(sample));
}

/// Path ids, which distinguish the bounces of a subpixel's rays: each id encodes the sequence of
/// mirrored and refracted rays from the eye.
inline constexpr uint32_t kFirstPath = 1;
enum class Turn : uint32_t { Mirrored, Refracted };
[[nodiscard]] inline uint32_t longer_path(uint32_t path, Turn turn) {
  return mixed(path * kGolden + static_cast<uint32_t>(turn));
}

/// Uses of samples.
inline constexpr uint32_t kUseAmbient = 0;
[[nodiscard]] constexpr uint32_t use_of_light(size_t light) {
  return 1 + static_cast<uint32_t>(light);
}

[[nodiscard]] inline SampleSet sample_set(std::span<const uint32_t, 16> seeds, uint32_t path,
                                          uint32_t use) {
  const uint32_t key = mixed(path + use * kGolden);
  SampleSet set;
  for (size_t r = 0; r < 16; ++r) {
    set.scramble[0][r] = mixed(seeds[r] ^ key);
    set.scramble[1][r] = mixed(set.scramble[0][r] + kGolden);
  }
  return set;
}
/// Returns point `index` of the set. Lifetime: `set` must outlive the sample.
[[nodiscard]] inline Sample sample_of(const SampleSet& set, uint32_t index) {
  // Row k of Pascal's triangle modulo 2 corresponds to bit k of the index.
  uint32_t second = 0;
  for (uint32_t left = index, row = 1; left != 0; left >>= 1, row ^= row << 1)
    if ((left & 1) != 0) second ^= row;
  return {&set, index, second};
}

}  // namespace lenticule::render::sampling

namespace lenticule::render {

/// SoftPacket is the input: the surfaces that one bounce of a packet's rays met.
struct SoftPacket {
  const Scene& scene;
  const shading_kernel::Surfaces& surfaces;
  std::span<const uint32_t, kPacket> seeds;  ///< sampling::subpixel_seed() of each lane
  uint32_t path;                             ///< sampling::longer_path() from the eye
  /// Noise level that is acceptable, relative to light 1: weak light gets fewer samples. 0 disables
  /// this.
  float noticed = 0.0F;
};

/// Bit masks of the lanes from which an area light is known to be entirely visible or entirely
/// hidden.
struct KnownLanes {
  uint32_t lit = 0;
  uint32_t blocked = 0;
};

/// Bit mask of the lanes whose share is known: the visible share of an area light, or the
/// unoccluded share of the hemisphere.
struct KnownShare {
  uint32_t lanes = 0;
  alignas(64) std::array<float, kPacket> share{};
  alignas(64) std::array<float, kPacket> apart{};  ///< spread of the interpolated values

  /// Sets shares that are exact, not interpolated.
  void set(uint32_t of_lanes, float value) {
    std::array<float, kPacket> values;
    values.fill(value);
    set(of_lanes, values);
  }
  void set(uint32_t of_lanes, std::span<const float, kPacket> values) {
    lanes |= of_lanes;
    for (size_t r = 0; r < kPacket; ++r) {
      const bool is_known = (of_lanes & kLaneBit[r]) != 0;
      share[r] = is_known ? values[r] : share[r];
      apart[r] = is_known ? 0.0F : apart[r];
    }
  }
};

/// Visibility of an area light: the visible share of its light in the lanes on which it would
/// shine, and bit masks of the lanes in which all or none of it is visible.
struct AreaLightSeen {
  uint32_t all = 0;
  uint32_t none = 0;
  KnownShare share{};
};

/// SoftShader samples soft light. It does not allocate after construction. Thread safety: used by
/// one thread.
class SoftShader {
 public:
  SoftShader(const SoftLight& options, Isa isa)
      : options_(options),
        kernel_(shading_kernel_for(isa)),
        sun_tangent_(
            static_cast<float>(std::tan(options.sun_radius_degrees * std::numbers::pi / 180.0))) {
    init_packets({&rays_, 1});
  }

  /// Sets a factor for the number of samples in the options; at least 1.
  void multiply_samples(int factor) { factor_ = factor; }
  /// Selects integration instead of sampling for area lights with a known visible share, which is
  /// cheaper and has less noise.
  void integrate_area_lights(bool integrate) { integrates_ = integrate; }
  [[nodiscard]] bool integrates_area_lights() const { return integrates_; }

  /// Returns true if the area light is sampled; other lights have hard shadows.
  [[nodiscard]] bool samples(const Scene& scene, const shading_kernel::Light& area_light) const {
    return radius(scene, area_light) > 0;
  }
  [[nodiscard]] bool samples_area_lights() const { return options_.shadow_samples > 0; }
  /// Returns true if it is useful to know that no geometry is near a surface.
  [[nodiscard]] bool looks_around() const {
    return options_.occlusion_samples > 0 && std::isfinite(options_.occlusion_distance_mm);
  }
  /// Returns true if ambient light is sampled; otherwise it is flat.
  [[nodiscard]] bool samples_ambient() const { return ambient_samples() > 0; }

  /// Returns the sizes of the sampled lights.
  [[nodiscard]] SoftSizes sizes(const Scene& scene) const {
    SoftSizes sizes;
    if (samples_area_lights())
      sizes = {.light_radius = options_.light_radius_mm * scene.units_per_mm,
               .sun_tangent = double{sun_tangent_}};
    if (looks_around()) sizes.around = options_.occlusion_distance_mm * scene.units_per_mm;
    return sizes;
  }

  /// Adds to light[r] the light of an area light that lane r reflects, multiplied by weight[r].
  /// Arrays have sixteen elements and are aligned to 64 bytes. `shares` is used if area lights are
  /// integrated.
  AreaLightSeen add_area_light(const SoftPacket& packet, size_t area_light, KnownLanes culled,
                               const KnownShare& shares, const float* weight, float* light,
                               WorkClock& clock) {
    if (integrates_)
      return integrate_area_light(packet, area_light, culled, shares, weight, light, clock);
    const AreaLightSamples all{.count = static_cast<uint32_t>(options_.shadow_samples * factor_),
                               .weight = weight,
                               .added = kAllLanes};
    return sample_area_light(packet, area_light, all, culled, light, clock);
  }
  /// Computes the ambient light of each lane in its channel. `backdrop` is the light of rays that
  /// meet nothing, if the backdrop is flat. Arrays as for add_area_light(). Rays of the lanes in
  /// the bit mask `open` are known to meet nothing. `known` is used if shares() is true. `weight`
  /// is the factor with which the caller uses the result.
  void find_ambient(const SoftPacket& packet, uint32_t open, const KnownShare& known,
                    const float* weight, const float* backdrop, float* ambient, WorkClock& clock) {
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
  /// Returns true if ambient light is a share of a light that is the same in all directions.
  [[nodiscard]] bool shares(const Scene& scene) const {
    return !lit_by_surroundings() || scene.backdrop.flat();
  }
  /// Returns the shares of the last find_ambient(), if shares() is true, for lanes that reflect
  /// ambient light.
  [[nodiscard]] const KnownShare& share() const { return share_; }

  [[nodiscard]] const FrameCounts& counts() const { return counts_; }

 private:
  /// Number of samples that cover all quarters of a disc: if the whole area light would shine on a
  /// point, one of them would.
  static constexpr int kFewSamples = 4;

  /// Largest spread of samples, in multiples of the noticeable light, at which a share is
  /// interpolated.
  static constexpr float kMostApart = 8.0F;
  /// Returns the radius in scene units, or as a tangent; 0 if the light is not sampled.
  [[nodiscard]] float radius(const Scene& scene, const shading_kernel::Light& area_light) const {
    const SoftSizes all = sizes(scene);
    const bool is_sun = area_light.kind == shading_kernel::Light::kDirectional;
    return static_cast<float>(is_sun ? all.sun_tangent : all.light_radius);
  }
  /// Returns the number of ambient samples; at most one of the two options is nonzero.
  [[nodiscard]] int ambient_samples() const {
    return options_.occlusion_samples + options_.environment_samples;
  }
  /// Returns the number of samples. The error of N samples is proportional to N^-3/4 times the
  /// light, so weaker light needs fewer. Light of kMuch takes all requested samples if one code
  /// value is noticeable; the error of sixteen samples is then three quarters of a code value.
  [[nodiscard]] uint32_t samples_for(float light, float noticed, int asked) const {
    constexpr float kMuch = 0.15F, kCode = 1.0F / 255;
    constexpr float kHalvesSamples = 0.5946F;  // 2^-3/4
    int samples = asked * factor_;
    float enough = kMuch / kCode * noticed * kHalvesSamples;
    for (; light <= enough && samples / 2 >= kFewSamples; enough *= kHalvesSamples) samples /= 2;
    return static_cast<uint32_t>(samples);
  }
  [[nodiscard]] bool lit_by_surroundings() const { return options_.environment_samples > 0; }
  /// Returns pointers into rays_ for the kernel's output.
  shading_kernel::NewRays into_rays() {
    shading_kernel::NewRays rays;
    rays.packet = &rays_.rays.ray.org_x[0];
    rays.valid = rays_.valid;
    return rays;
  }
  /// Traces the valid lanes of rays_; returns a bit mask of the lanes that met nothing.
  uint32_t unblocked(const Scene& scene, Coherence coherence, WorkClock& clock) {
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
  /// Disables rays to an area light whose visibility is known; returns the lanes whose rays reach
  /// the light.
  uint32_t resolve(KnownLanes known) {
    const uint32_t wanted = lane_bits(rays_.valid);
    const uint32_t lit = known.lit & wanted;
    const uint32_t blocked = known.blocked & wanted;
    counts_.shadow_rays += static_cast<uint64_t>(std::popcount(wanted));
    counts_.shadow_rays_culled += static_cast<uint64_t>(std::popcount(lit));
    counts_.shadow_rays_blocked += static_cast<uint64_t>(std::popcount(blocked));
    take_lanes(lit | blocked, rays_.valid);
    return lit;
  }
  /// Integrates an area light. If the whole light would shine on a point, the result is the
  /// integral times the visible share. A culling result gives the same share as traced rays, so
  /// that no byte depends on which shafts happen to be culled. If a part of the light is below the
  /// horizon, the unknown light is the sum of the samples.
  AreaLightSeen integrate_area_light(const SoftPacket& packet, size_t area_light, KnownLanes culled,
                                     const KnownShare& shares, const float* weight, float* light,
                                     WorkClock& clock) {
    const shading_kernel::Light& shape = packet.scene.shading->lights()[area_light];
    alignas(64) std::array<float, kPacket> brings, of_sampled;
    const shading_kernel::AreaLightLanes shines = kernel_.whole_area_light(
        shape, radius(packet.scene, shape), packet.surfaces, weight, brings.data());
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
  static uint32_t agreeing(const KnownShare& shares, const float* brings, float noticed) {
    const float most = kMostApart * noticed;
    uint32_t lanes = 0;
    for (size_t r = 0; r < kPacket; ++r)
      lanes |= shares.apart[r] * brings[r] <= most ? shares.lanes & kLaneBit[r] : 0;
    return lanes;
  }
  /// `brings`: light of the entire area light per lane.
  /// Adds the shares of the given lanes; also finds the lanes in which all or none of the light is
  /// visible.
  static void add_shares(AreaLightSeen& seen, uint32_t lanes, const float* brings, float* light) {
    for (size_t r = 0; r < kPacket; ++r) {
      const uint32_t bit = lanes & kLaneBit[r];
      const float share = seen.share.share[r];
      light[r] += bit != 0 ? share * brings[r] : 0.0F;
      seen.all |= share == 1.0F ? bit : 0;
      seen.none |= share == 0.0F ? bit : 0;
    }
  }
  void count_known(KnownLanes known) {
    const auto rays = [&](uint32_t lanes) {
      return static_cast<uint64_t>(options_.shadow_samples * factor_) *
             static_cast<uint64_t>(std::popcount(lanes));
    };
    counts_.shadow_rays += rays(known.lit | known.blocked);
    counts_.shadow_rays_culled += rays(known.lit);
    counts_.shadow_rays_blocked += rays(known.blocked);
  }
  struct AreaLightSamples {
    uint32_t count;
    const float* weight;  ///< per lane; 0 = no light needed
    uint32_t added;       ///< bit mask of lanes whose light is added
  };
  AreaLightSeen sample_area_light(const SoftPacket& packet, size_t area_light,
                                  const AreaLightSamples& asked, KnownLanes known, float* light,
                                  WorkClock& clock) {
    const shading_kernel::Light& shape = packet.scene.shading->lights()[area_light];
    alignas(64) std::array<float, kPacket> part;
    alignas(64) std::array<float, kPacket> arriving{}, arrived{};
    for (size_t r = 0; r < kPacket; ++r)
      part[r] = asked.weight[r] / static_cast<float>(asked.count);
    const sampling::SampleSet set =
        sampling::sample_set(packet.seeds, packet.path, sampling::use_of_light(area_light));
    shading_kernel::NewRays rays = into_rays();
    const float size = radius(packet.scene, shape);
    uint32_t ever_wanted = 0, ever_seen = 0, ever_hidden = 0;
    for (uint32_t i = 0; i < asked.count; ++i) {
      const bool any = kernel_.area_light_rays(shape, size, sampling::sample_of(set, i),
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
  /// Results of the ambient rays of each lane.
  struct Around {
    uint32_t lanes = 0;                    ///< bit mask of the lanes that were sampled or known
    std::array<uint32_t, kPacket> open{};  ///< number of rays that met nothing
    std::array<double, kPacket> light{};   ///< sum of the light of the sky or environment picture
  };
  Around look_around(const SoftPacket& packet, uint32_t samples, uint32_t open, WorkClock& clock) {
    const bool pictured = lit_by_surroundings() && !packet.scene.backdrop.flat();
    const float far =
        lit_by_surroundings()
            ? std::numeric_limits<float>::infinity()
            : static_cast<float>(options_.occlusion_distance_mm * packet.scene.units_per_mm);
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
      counts_.ambient_rays_culled +=
          uint64_t{of_known} * static_cast<uint64_t>(std::popcount(known));
      take_lanes(known, rays_.valid);
      const uint32_t traced = unblocked(packet.scene, Coherence::Incoherent, clock);
      for (size_t r = 0; r < kPacket; ++r)
        around.open[r] += (known >> r & 1) * of_known + (traced >> r & 1);
      if (pictured) add_surroundings(packet, traced, around.light);
      if (known == wanted) break;
    }
    return around;
  }
  /// Adds the light of an environment picture or sky in the directions of rays_.
  void add_surroundings(const SoftPacket& packet, uint32_t lanes, std::span<double, kPacket> sum) {
    const RTCRay16& ray = rays_.rays.ray;
    for (uint32_t left = lanes; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      const Vec3 direction{double{ray.dir_x[r]}, double{ray.dir_y[r]}, double{ray.dir_z[r]}};
      sum[r] +=
          backdrop_light(packet.scene.backdrop, normalized(direction), packet.surfaces.channel[r]);
    }
  }

  SoftLight options_;
  const shading_kernel::Kernel& kernel_;
  float sun_tangent_;
  int factor_ = 1;
  bool integrates_ = false;
  RayPacket rays_;
  KnownShare share_;
  FrameCounts counts_;
};

}  // namespace lenticule::render
