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

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/cpu.h"
#include "render/accel/ray_stream.h"
#include "render/culling/shaft.h"
#include "render/options/render_options.h"
#include "render/scene/scene.h"
#include "render/shading/shading_kernel.h"

namespace lenticule::render::sampling {

/// Returns a hash in which every input bit affects all bits.
[[nodiscard]] uint32_t mixed(uint32_t bits);

/// Returns a seed that is specific to a subpixel. It does not contain the frame number, since still
/// pictures must not flicker. `sample` numbers the rays inside the subpixel
/// (RenderOptions::samples).
[[nodiscard]] uint32_t subpixel_seed(int row, int subpixel, int sample);

/// Path ids, which distinguish the bounces of a subpixel's rays: each id encodes the sequence of
/// mirrored and refracted rays from the eye.
inline constexpr uint32_t kFirstPath = 1;
enum class Turn : uint32_t { Mirrored, Refracted };
[[nodiscard]] uint32_t longer_path(uint32_t path, Turn turn);

/// Uses of samples.
inline constexpr uint32_t kUseAmbient = 0;
[[nodiscard]] constexpr uint32_t use_of_light(size_t light) {
  return 1 + static_cast<uint32_t>(light);
}

[[nodiscard]] SampleSet sample_set(std::span<const uint32_t, 16> seeds, uint32_t path,
                                   uint32_t use);
/// Returns point `index` of the set. Lifetime: `set` must outlive the sample.
[[nodiscard]] Sample sample_of(const SampleSet& set, uint32_t index);

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
  void set(uint32_t of_lanes, float value);
  void set(uint32_t of_lanes, std::span<const float, kPacket> values);
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
  SoftShader(const SoftLight& options, Isa isa);

  /// Sets a factor for the number of samples in the options; at least 1.
  void multiply_samples(int factor) { factor_ = factor; }
  /// Selects integration instead of sampling for area lights with a known visible share, which is
  /// cheaper and has less noise.
  void integrate_area_lights(bool integrate) { integrates_ = integrate; }
  [[nodiscard]] bool integrates_area_lights() const { return integrates_; }

  /// Returns true if the area light is sampled; other lights have hard shadows.
  [[nodiscard]] bool samples(const shading_kernel::Light& area_light) const {
    return radius(area_light) > 0;
  }
  [[nodiscard]] bool samples_area_lights() const { return options_.shadow_samples > 0; }
  /// Returns true if it is useful to know that no geometry is near a surface.
  [[nodiscard]] bool looks_around() const;
  /// Returns true if ambient light is sampled; otherwise it is flat.
  [[nodiscard]] bool samples_ambient() const { return ambient_samples() > 0; }

  /// Returns the sizes of the sampled lights.
  [[nodiscard]] SoftSizes sizes() const;

  /// Adds to light[r] the light of an area light that lane r reflects, multiplied by weight[r].
  /// Arrays have sixteen elements and are aligned to 64 bytes. `shares` is used if area lights are
  /// integrated.
  AreaLightSeen add_area_light(const SoftPacket& packet, size_t area_light, KnownLanes culled,
                               const KnownShare& shares, const float* weight, float* light,
                               WorkClock& clock);
  /// Computes the ambient light of each lane in its channel. `backdrop` is the light of rays that
  /// meet nothing, if the backdrop is flat. Arrays as for add_area_light(). Rays of the lanes in
  /// the bit mask `open` are known to meet nothing. `known` is used if shares() is true. `weight`
  /// is the factor with which the caller uses the result.
  void find_ambient(const SoftPacket& packet, uint32_t open, const KnownShare& known,
                    const float* weight, const float* backdrop, float* ambient, WorkClock& clock);
  /// Returns true if ambient light is a share of a light that is the same in all directions.
  [[nodiscard]] bool shares(const Scene& scene) const {
    return !lit_by_surroundings() || scene.backdrop.flat();
  }
  /// Returns the shares of the last find_ambient(), if shares() is true, for lanes that reflect
  /// ambient light.
  [[nodiscard]] const KnownShare& share() const { return share_; }

  [[nodiscard]] const FrameCounts& counts() const { return counts_; }

 private:
  /// Returns the radius in scene units, or as a tangent; 0 if the light is not sampled.
  [[nodiscard]] float radius(const shading_kernel::Light& area_light) const;
  /// Returns the number of ambient samples; at most one of the two options is nonzero.
  [[nodiscard]] int ambient_samples() const {
    return options_.occlusion_samples + options_.environment_samples;
  }
  [[nodiscard]] uint32_t samples_for(float light, float noticed, int asked) const;
  [[nodiscard]] bool lit_by_surroundings() const { return options_.environment_samples > 0; }
  /// Returns pointers into rays_ for the kernel's output.
  shading_kernel::NewRays into_rays();
  /// Traces the valid lanes of rays_; returns a bit mask of the lanes that met nothing.
  uint32_t unblocked(const Scene& scene, Coherence coherence, WorkClock& clock);
  uint32_t resolve(KnownLanes known);
  AreaLightSeen integrate_area_light(const SoftPacket& packet, size_t area_light, KnownLanes culled,
                                     const KnownShare& shares, const float* weight, float* light,
                                     WorkClock& clock);
  static uint32_t agreeing(const KnownShare& shares, const float* brings, float noticed);
  /// `brings`: light of the entire area light per lane.
  static void add_shares(AreaLightSeen& seen, uint32_t lanes, const float* brings, float* light);
  void count_known(KnownLanes known);
  struct AreaLightSamples {
    uint32_t count;
    const float* weight;  ///< per lane; 0 = no light needed
    uint32_t added;       ///< bit mask of lanes whose light is added
  };
  AreaLightSeen sample_area_light(const SoftPacket& packet, size_t area_light,
                                  const AreaLightSamples& asked, KnownLanes known, float* light,
                                  WorkClock& clock);
  /// Results of the ambient rays of each lane.
  struct Around {
    uint32_t lanes = 0;                    ///< bit mask of the lanes that were sampled or known
    std::array<uint32_t, kPacket> open{};  ///< number of rays that met nothing
    std::array<double, kPacket> light{};   ///< sum of the light of the sky or environment picture
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
  FrameCounts counts_;
};

}  // namespace lenticule::render
