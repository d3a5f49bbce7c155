// SPDX-License-Identifier: Apache-2.0
// Records of the light that a packet's lanes receive: LightRecord, taken while a packet is traced,
// and CachedLight, which saves rays when other packets are shaded.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "render/accel/ray_stream.h"
#include "render/integrator/packet_tracer.h"
#include "render/scene/surface_groups.h"
#include "render/shading/shading_kernel.h"
#include "render/shading/soft_shader.h"

namespace lenticule::render {

/// LightRecord are the path records of the lanes of a packet.
struct LightRecord {
  /// Number of area lights whose visible shares are recorded.
  static constexpr size_t kAreaLights = 8;
  static constexpr float kNoShare = -1.0F;

  /// Path ids: hashes of the surfaces met and of the lights hidden from them, as far as those can
  /// matter. Equal ids mean that nothing differs. `way` covers the ray itself, `secondary_way`
  /// its mirrored and refracted rays.
  alignas(64) uint32_t way[kPacket];
  alignas(64) uint32_t secondary_way[kPacket];
  /// Light of the secondary rays; part of the lane's light.
  alignas(64) float secondary[kPacket];
  /// A bit for each of the first 32 lights: `lit` if the light shines on the surface that the
  /// primary ray met, `hidden` if it is occluded. Neither bit is set if the light is behind the
  /// surface. For an area light: entirely visible, entirely hidden, or neither.
  alignas(64) uint32_t lit[kPacket];
  alignas(64) uint32_t hidden[kPacket];
  /// Unoccluded share of the hemisphere, if ambient occlusion is sampled; kNoShare on surfaces
  /// that reflect no ambient light.
  alignas(64) float around[kPacket];
  /// Visible shares of the first area lights, per lane; kNoShare if the light cannot shine on the
  /// lane's surface anyway.
  alignas(64) float seen[kAreaLights][kPacket];
};

/// CachedLight holds the results for sixteen rays that need not be traced again.
struct CachedLight {
  static constexpr size_t kLights = 32;  ///< number of lights covered, starting with the first
  uint32_t lit[kLights];                 ///< bits of the lanes on which a light shines, by light,
  uint32_t hidden[kLights];              ///< and for each lane from which the light is hidden
  uint32_t secondary_lanes;  ///< lanes whose mirrored and refracted rays contribute `secondary`
  alignas(64) float secondary[kPacket];
  KnownShare around;  ///< see LightRecord
  KnownShare
      seen[LightRecord::kAreaLights];  ///< see LightRecord; used if area lights are integrated

  /// Sets `lit` and `hidden` from a bit mask of lights per lane, as in LightRecord.
  void set_lights(std::span<const uint32_t, kPacket> shining,
                  std::span<const uint32_t, kPacket> not_seen);
};

// LightCache is what method adaptive adds to the tracing of a packet: it notes how the light of
// each lane came about, and supplies light and hits that are known already. PacketTracer calls it
// while it traces for a RecordingTracer, and has none in all other methods.

/// LightCache serves one packet at a time: begin_...(), calls of the tracer, end(). Thread safety:
/// used by one thread. It keeps its memory from packet to packet.
class LightCache {
 public:
  // ---- for RecordingTracer

  /// Begins the notes of a packet and the record of its hits. Light below `noticed` does not affect
  /// the notes. Lifetime: `groups` must live until end().
  void begin_recording(const SurfaceGroups& groups, float noticed);
  /// Begins a packet whose light is partly known. `again` states that its rays are those of the
  /// last begin_recording() in another colour. Lifetime: `known` must live until end().
  void begin_known(const CachedLight& known, bool again);
  /// Ends a packet; `light` is the light of its lanes.
  void end(const float* light);
  [[nodiscard]] const LightRecord& notes() const { return notes_; }

  // ---- for PacketTracer

  /// Bounce identifies the rays of the packet that met the surfaces.
  struct Bounce {
    uint32_t path;  ///< sampling::longer_path()
    bool is_first;  ///< the primary rays
  };

  /// Returns true if soft light must have no more noise than necessary: noted surfaces serve many
  /// subpixels, which would then share the same noise.
  [[nodiscard]] bool wants_accuracy(Bounce bounce) const {
    return groups_ != nullptr && bounce.is_first;
  }

  void record_surfaces(Bounce bounce, const RayPacket& packet,
                       const shading_kernel::Surfaces& surfaces, const float* weight);

  /// Notes the surface that a lane met; `how` tells the ways of meeting it apart.
  void record_surface(Bounce bounce, size_t lane, uint32_t geometry, uint32_t primitive,
                      uint32_t how);

  /// Returns the lanes whose unoccluded share of the hemisphere is known.
  [[nodiscard]] KnownShare known_around(Bounce bounce);
  /// Notes the share of the hemisphere; `serves_all_colours` if the other colours have the same.
  void keep_around(Bounce bounce, const KnownShare& share, bool serves_all_colours);

  /// Sets the lanes of `valid` to invalid in which a light is known to be visible or hidden;
  /// returns those in which it is visible.
  uint32_t take_known(Bounce bounce, size_t light, int* valid) const;
  /// Returns the lanes that the light reaches, if the same shadow rays were traced before.
  [[nodiscard]] std::optional<uint32_t> find_shadows(Bounce bounce, size_t light, uint32_t lanes);
  void store_shadows(Bounce bounce, size_t light, uint32_t lanes, uint32_t unoccluded);
  /// Notes the shadows of a light. Only shadows from lights in front of a surface that contribute
  /// noticeably matter; `brings` is the light of each lane if unoccluded.
  void record_shadows(Bounce bounce, size_t light, const float* brings, uint32_t wanted,
                      uint32_t reached);
  /// Notes lanes that a part of a light reaches.
  void record_partly(Bounce bounce, size_t light, uint32_t lanes);

  /// Adds what is known of an area light to `lanes`, and returns its known shares. Recorded shares
  /// are used only if area lights are integrated.
  [[nodiscard]] KnownShare known_area_light(Bounce bounce, size_t light, bool integrated,
                                            KnownLanes& lanes);
  void keep_area_light(Bounce bounce, size_t light, const AreaLightSeen& seen);

  /// Separates the light of the first surfaces, which `light` holds, from that of their secondary
  /// rays. Adds known light of secondary rays, and returns the weights of the lanes of which it is
  /// not known.
  const float* end_first_surfaces(const shading_kernel::Kernel& kernel, const float* weight,
                                  float* light);
  /// Ends a packet whose secondary rays are not noted: `light` is all light of the first surfaces.
  void end_only_surfaces(const float* light) { std::copy_n(light, kPacket, notes_.secondary); }
  /// Sets the hits of a packet, and returns true, if the same rays were traced before.
  [[nodiscard]] bool find_hits(uint32_t path, RayPacket& packet);
  void store_hits(uint32_t path, const RayPacket& packet);

 private:
  /// Traced stores the hits of a packet, for reuse with the same rays.
  struct Traced {
    uint32_t path;   ///< sampling::longer_path() of the rays
    uint32_t what;   ///< light to which the rays went, kNotToLight or kAllAround
    uint32_t lanes;  ///< bit mask of the traced lanes
    uint32_t free;   ///< bit mask of the lanes with an unoccluded light
    float distance[kPacket];
    uint32_t geometry[kPacket];
    uint32_t primitive[kPacket];
    float share[kPacket];  ///< visible share of a light, or of the hemisphere
  };
  static constexpr uint32_t kNotToLight = ~0U;
  static constexpr uint32_t kAllAround = ~1U;

  [[nodiscard]] uint32_t* way_of(Bounce bounce) {
    return bounce.is_first ? notes_.way : notes_.secondary_way;
  }
  Traced* store(uint32_t path, uint32_t what, uint32_t lanes);
  const Traced* find(uint32_t path, uint32_t what);
  void store_share(uint32_t path, uint32_t what, const KnownShare& share);
  void find_share(uint32_t path, uint32_t what, KnownShare& known);

  LightRecord notes_;
  const SurfaceGroups* groups_ = nullptr;  ///< groups of the surfaces in the notes
  float noticed_ = 0.0F;
  const CachedLight* known_ = nullptr;
  enum class Hits { Off, Write, Read } hits_ = Hits::Off;
  std::vector<Traced> traced_;              ///< ordered by time of tracing
  size_t passed_ = 0;                       ///< entries before this one are no longer needed
  alignas(64) float weight_left_[kPacket];  ///< weights of primary rays with unknown secondary rays
};

/// RecordingTracer is a PacketTracer with a LightCache. Thread safety: used by one thread.
class RecordingTracer : public PacketTracer {
 public:
  using PacketTracer::PacketTracer;

  /// Traces like trace_lanes(), fills notes() with the path records of the lanes, and stores all
  /// hits for trace_known(). Light below `noticed` does not affect the records.
  void trace_recording(const Scene& scene, const TilePlan& plan,
                       std::span<const int32_t, kPacket> channel, const SurfaceGroups& groups,
                       float noticed, RayPacket& packet, std::span<float, kPacket> light) {
    cache_.begin_recording(groups, noticed);
    use(&cache_);
    trace_lanes(scene, plan, channel, packet, light);
    use(nullptr);
    cache_.end(light.data());
  }
  /// Returns the records of the last trace_recording().
  [[nodiscard]] const LightRecord& notes() const { return cache_.notes(); }

  /// Shades like trace_lanes() a packet that already holds the hits of its primary rays. Shading is
  /// exact; `known` saves rays. Afterwards notes().secondary is valid, all other notes are not.
  /// `again` states that the packet is that of the last trace_recording() in another colour, so
  /// that its rays have the same hits.
  void trace_known(const Scene& scene, const TilePlan& plan,
                   std::span<const int32_t, kPacket> channel, const CachedLight& known,
                   const RayPacket& packet, std::span<float, kPacket> light, bool again = false) {
    cache_.begin_known(known, again);
    use(&cache_);
    shade_lanes(scene, plan, channel, packet, light);
    use(nullptr);
    cache_.end(light.data());
  }
  using PacketTracer::pbr_light;

 private:
  LightCache cache_;
};

}  // namespace lenticule::render
