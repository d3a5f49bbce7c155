// SPDX-License-Identifier: Apache-2.0
// Light of a packet's surfaces that is sampled by several rays a point: of lamps that have a size,
// and of what comes from all around.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "base/cpu.h"
#include "render/accel/ray_stream.h"
#include "render/culling/shaft_proofs.h"
#include "render/options/soft_light.h"
#include "render/options/work_clock.h"
#include "render/scene/scene.h"
#include "render/shading/sample_set.h"
#include "render/shading/shading_kernel.h"

namespace lenticule::render {

/// What is shaded: surfaces that one generation of a packet's rays met.
struct SoftPacket {
  const Scene& scene;
  const shading_kernel::Surfaces& surfaces;
  std::span<const uint32_t, kPacket> seeds;  ///< sampling::subpixel_seed() of each lane
  uint32_t path;                             ///< sampling::longer_path() from the eye
  /// Light, of 1, that may be noise: of what brings little fewer samples are taken. 0 = of nothing.
  float noticed = 0.0F;
};

/// Lanes from which all of a lamp is known to be seen, or nothing of it; a bit each.
struct KnownLanes {
  uint32_t lit = 0;
  uint32_t blocked = 0;
};

/// Lanes, a bit each, whose share is known: of a lamp that is seen, or of directions that are free.
struct KnownShare {
  uint32_t lanes = 0;
  alignas(64) std::array<float, kPacket> share{};
  alignas(64) std::array<float, kPacket> apart{};  ///< what it was found from differs by

  /// Exactly.
  void set(uint32_t of_lanes, float value);
  void set(uint32_t of_lanes, std::span<const float, kPacket> values);
};

/// How much of a lamp was seen: the share of its light that arrived, of lanes on which it would
/// shine, and those of which all or none of it did; a bit each.
struct LampSeen {
  uint32_t all = 0;
  uint32_t none = 0;
  KnownShare share{};
};

/// Of one thread; allocates nothing once it is made.
class SoftShader {
 public:
  SoftShader(const SoftLight& options, Isa isa);

  /// That many times the samples of the options, from now on; at least 1.
  void multiply_samples(int factor) { factor_ = factor; }
  /// From now on lamps of which a known share is seen are integrated, not sampled: smoother than
  /// samples, and cheaper.
  void integrate_lamps(bool integrate) { integrates_ = integrate; }
  [[nodiscard]] bool integrates_lamps() const { return integrates_; }

  /// Whether the lamp is sampled; others have hard shadows.
  [[nodiscard]] bool samples(const shading_kernel::Light& lamp) const { return radius(lamp) > 0; }
  [[nodiscard]] bool samples_lamps() const { return options_.shadow_samples > 0; }
  /// Whether it is worth knowing that nothing is near a surface.
  [[nodiscard]] bool looks_around() const;
  /// Whether light from all around is sampled; it is flat otherwise.
  [[nodiscard]] bool samples_ambient() const { return ambient_samples() > 0; }

  /// Of what is sampled.
  [[nodiscard]] SoftSizes sizes() const;

  struct Counts {
    uint64_t shadow = 0;
    uint64_t shadow_proved = 0;
    uint64_t shadow_blocked = 0;
    uint64_t ambient = 0;
    uint64_t ambient_proved = 0;
    uint64_t invalid = 0;
  };
  /// Adds to light[r] what lane r sends back of the lamp, weight[r] times. Arrays of sixteen,
  /// aligned to 64 bytes. `shares` are used where lamps are integrated.
  LampSeen add_lamp(const SoftPacket& packet, size_t lamp, KnownLanes proved,
                    const KnownShare& shares, const float* weight, float* light, WorkClock& clock);
  /// What reaches each lane from all around, in its channel, where `backdrop` is seen if that is
  /// flat. Arrays as above. The rays of lanes in `open`, a bit each, are known to meet nothing.
  /// What is `known` is used where shares() is true. It is wanted `weight` times.
  void find_ambient(const SoftPacket& packet, uint32_t open, const KnownShare& known,
                    const float* weight, const float* backdrop, float* ambient, WorkClock& clock);
  /// Whether light from all around is a share of one that is the same everywhere.
  [[nodiscard]] bool shares(const Scene& scene) const {
    return !lit_by_surroundings() || scene.backdrop.flat();
  }
  /// That of the last find_ambient(), if it is; of lanes that reflect such light.
  [[nodiscard]] const KnownShare& share() const { return share_; }

  [[nodiscard]] const Counts& counts() const { return counts_; }

 private:
  /// In scene units, or as a tangent; 0 for what is not sampled.
  [[nodiscard]] float radius(const shading_kernel::Light& lamp) const;
  /// One of the two is zero.
  [[nodiscard]] int ambient_samples() const {
    return options_.occlusion_samples + options_.environment_samples;
  }
  [[nodiscard]] uint32_t samples_for(float light, float noticed, int asked) const;
  [[nodiscard]] bool lit_by_surroundings() const { return options_.environment_samples > 0; }
  /// For the kernel, to write into rays_.
  shading_kernel::NewRays into_rays();
  /// Of the lanes of rays_ that are valid: which met nothing, a bit each.
  uint32_t unblocked(const Scene& scene, Coherence coherence, WorkClock& clock);
  uint32_t settle(KnownLanes known);
  LampSeen integrate_lamp(const SoftPacket& packet, size_t lamp, KnownLanes proved,
                          const KnownShare& shares, const float* weight, float* light,
                          WorkClock& clock);
  static uint32_t agreeing(const KnownShare& shares, const float* brings, float noticed);
  /// `brings`: what all of the lamp would bring.
  static void add_shares(LampSeen& seen, uint32_t lanes, const float* brings, float* light);
  void count_known(KnownLanes known);
  struct LampSamples {
    uint32_t count;
    const float* weight;  ///< of lanes; 0 = none are wanted
    uint32_t added;       ///< lanes whose light is added, a bit each
  };
  LampSeen sample_lamp(const SoftPacket& packet, size_t lamp, const LampSamples& asked,
                       KnownLanes known, float* light, WorkClock& clock);
  /// What the samples around each lane met.
  struct Around {
    uint32_t lanes = 0;                    ///< a bit for each that was sampled, or known
    std::array<uint32_t, kPacket> open{};  ///< how many met nothing
    std::array<double, kPacket> light{};   ///< of a sky or a picture, their sum
  };
  Around look_around(const SoftPacket& packet, uint32_t samples, uint32_t open, WorkClock& clock);
  void add_surroundings(const SoftPacket& packet, uint32_t lanes, std::span<double, kPacket> sum);

  SoftLight options_;
  const shading_kernel::Kernel& kernel_;
  float sun_tangent_;
  int factor_ = 1;
  bool integrates_ = false;
  RayPacket rays_;
  KnownShare share_;
  Counts counts_;
};

}  // namespace lenticule::render
