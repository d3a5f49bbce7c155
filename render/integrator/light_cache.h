// SPDX-License-Identifier: Apache-2.0
// Records of the light that a packet's lanes receive: LightRecord, taken while a packet is traced,
// and CachedLight, which saves rays when other packets are shaded.
#pragma once

#include <algorithm>
#include <bit>
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
                  std::span<const uint32_t, kPacket> not_seen) {
    by_light(shining, lit);
    by_light(not_seen, hidden);
  }

 private:
  /// Transposes a bit mask of lights per lane to a bit mask of lanes per light.
  static void by_light(std::span<const uint32_t, kPacket> of_lanes,
                       std::span<uint32_t, kLights> lanes) {
    uint32_t any = 0;
    for (const uint32_t of_lane : of_lanes) any |= of_lane;
    std::fill(lanes.begin(), lanes.end(), 0U);
    for (uint32_t left = any; left != 0; left &= left - 1) {
      const uint32_t light = left & (0U - left);
      int has[kPacket];
      for (size_t r = 0; r < kPacket; ++r) has[r] = (of_lanes[r] & light) != 0 ? -1 : 0;
      lanes[static_cast<size_t>(std::countr_zero(light))] = lane_bits(has);
    }
  }
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
  void begin_recording(const SurfaceGroups& groups, float noticed) {
    groups_ = &groups;
    noticed_ = noticed;
    notes_ = {};
    traced_.clear();
    hits_ = Hits::Write;
  }
  /// Begins a packet whose light is partly known. `again` states that its rays are those of the
  /// last begin_recording() in another colour. Lifetime: `known` must live until end().
  void begin_known(const CachedLight& known, bool again) {
    known_ = &known;
    hits_ = again ? Hits::Read : Hits::Off;
    passed_ = 0;
    std::fill_n(notes_.secondary, kPacket, 0.0F);
  }
  /// Ends a packet; `light` is the light of its lanes.
  void end(const float* light) {
    for (size_t r = 0; r < kPacket; ++r) {
      notes_.secondary[r] = light[r] - notes_.secondary[r];
      notes_.way[r] += notes_.secondary_way[r];
    }
    groups_ = nullptr;
    known_ = nullptr;
    hits_ = Hits::Off;
  }
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
                       const shading_kernel::Surfaces& surfaces, const float* weight) {
    if (groups_ == nullptr) return;
    uint32_t* way = way_of(bounce);
    for (size_t r = 0; r < kPacket; ++r) {
      if (surfaces.active[r] == 0 || (!bounce.is_first && weight[r] < noticed_)) continue;
      way[r] +=
          mixed(bounce.path, groups_->of(packet.rays.hit.geomID[r], packet.rays.hit.primID[r]));
    }
  }

  /// Notes the surface that a lane met; `how` tells the ways of meeting it apart.
  void record_surface(Bounce bounce, size_t lane, uint32_t geometry, uint32_t primitive,
                      uint32_t how) {
    if (groups_ == nullptr) return;
    way_of(bounce)[lane] += mixed(mixed(bounce.path, how), groups_->of(geometry, primitive));
  }

  /// Returns the lanes whose unoccluded share of the hemisphere is known.
  [[nodiscard]] KnownShare known_around(Bounce bounce) {
    KnownShare known;
    if (known_ != nullptr && bounce.is_first) known = known_->around;
    find_share(bounce.path, kAllAround, known);
    return known;
  }
  /// Notes the share of the hemisphere; `serves_all_colours` if the other colours have the same.
  void keep_around(Bounce bounce, const KnownShare& share, bool serves_all_colours) {
    if (serves_all_colours) store_share(bounce.path, kAllAround, share);
    if (groups_ != nullptr && bounce.is_first) record_shares(share, notes_.around);
  }

  /// Sets the lanes of `valid` to invalid in which a light is known to be visible or hidden;
  /// returns those in which it is visible.
  uint32_t take_known(Bounce bounce, size_t light, int* valid) const {
    if (known_ == nullptr || !bounce.is_first || light >= CachedLight::kLights) return 0;
    const uint32_t wanted = lane_bits(valid);
    const uint32_t lit = known_->lit[light] & wanted;
    take_lanes(lit | (known_->hidden[light] & wanted), valid);
    return lit;
  }
  /// Returns the lanes that the light reaches, if the same shadow rays were traced before.
  [[nodiscard]] std::optional<uint32_t> find_shadows(Bounce bounce, size_t light, uint32_t lanes) {
    const Traced* known = find(bounce.path, static_cast<uint32_t>(light));
    if (known == nullptr || (lanes & ~known->lanes) != 0) return {};
    return known->free & lanes;
  }
  void store_shadows(Bounce bounce, size_t light, uint32_t lanes, uint32_t unoccluded) {
    if (Traced* entry = store(bounce.path, static_cast<uint32_t>(light), lanes))
      entry->free = unoccluded;
  }
  /// Notes the shadows of a light. Only shadows from lights in front of a surface that contribute
  /// noticeably matter; `brings` is the light of each lane if unoccluded.
  void record_shadows(Bounce bounce, size_t light, const float* brings, uint32_t wanted,
                      uint32_t reached) {
    if (groups_ == nullptr) return;
    uint32_t* way = way_of(bounce);
    for (uint32_t left = wanted & ~reached; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      if (brings[r] >= noticed_) way[r] += mixed(~bounce.path, static_cast<uint32_t>(light));
    }
    if (!bounce.is_first || light >= CachedLight::kLights) return;
    const uint32_t bit = 1U << light, hidden = wanted & ~reached;
    for (size_t r = 0; r < kPacket; ++r) {
      notes_.lit[r] |= (reached & kLaneBit[r]) != 0 ? bit : 0;
      notes_.hidden[r] |= (hidden & kLaneBit[r]) != 0 ? bit : 0;
    }
  }
  /// Notes lanes that a part of a light reaches.
  void record_partly(Bounce bounce, size_t light, uint32_t lanes) {
    if (groups_ == nullptr) return;
    for (uint32_t left = lanes; left != 0; left &= left - 1)
      way_of(bounce)[std::countr_zero(left)] +=
          mixed(~bounce.path, static_cast<uint32_t>(light) + kPartly);
  }

  /// Adds what is known of an area light to `lanes`, and returns its known shares. Recorded shares
  /// are used only if area lights are integrated.
  [[nodiscard]] KnownShare known_area_light(Bounce bounce, size_t light, bool integrated,
                                            KnownLanes& lanes) {
    KnownShare shares;
    if (known_ != nullptr && bounce.is_first && light < CachedLight::kLights) {
      lanes.lit |= known_->lit[light];
      lanes.blocked |= known_->hidden[light];
      if (light < LightRecord::kAreaLights) shares = known_->seen[light];
      shares.set(known_->lit[light], 1.0F);
      shares.set(known_->hidden[light], 0.0F);
    }
    if (integrated) find_share(bounce.path, static_cast<uint32_t>(light), shares);
    return shares;
  }
  /// Notes a penumbra only as "partly lit": the light values themselves distinguish penumbrae.
  void keep_area_light(Bounce bounce, size_t light, const AreaLightSeen& seen) {
    const auto number = static_cast<uint32_t>(light);
    store_share(bounce.path, number, seen.share);
    if (groups_ == nullptr) return;
    uint32_t* way = way_of(bounce);
    for (uint32_t r = 0; r < kPacket; ++r) {
      const uint32_t bit = 1U << r;
      if ((seen.none & bit) != 0) way[r] += mixed(~bounce.path, number);
      if ((seen.share.lanes & ~(seen.all | seen.none) & bit) != 0)
        way[r] += mixed(~bounce.path, number + kPartly);
      if (!bounce.is_first || light >= CachedLight::kLights) continue;
      notes_.lit[r] |= (seen.all >> r & 1) << light;
      notes_.hidden[r] |= (seen.none >> r & 1) << light;
    }
    if (bounce.is_first && light < LightRecord::kAreaLights)
      record_shares(seen.share, notes_.seen[light]);
  }

  /// Separates the light of the first surfaces, which `light` holds, from that of their secondary
  /// rays. Adds known light of secondary rays, and returns the weights of the lanes of which it is
  /// not known.
  const float* end_first_surfaces(const shading_kernel::Kernel& kernel, const float* weight,
                                  float* light) {
    std::copy_n(light, kPacket, notes_.secondary);  // subtracted by end()
    if (known_ == nullptr) return weight;
    kernel.add_light(known_->secondary_lanes, known_->secondary, light);
    for (size_t r = 0; r < kPacket; ++r)
      weight_left_[r] = (known_->secondary_lanes & kLaneBit[r]) != 0 ? 0.0F : weight[r];
    return weight_left_;
  }
  /// Ends a packet whose secondary rays are not noted: `light` is all light of the first surfaces.
  void end_only_surfaces(const float* light) { std::copy_n(light, kPacket, notes_.secondary); }
  /// Sets the hits of a packet, and returns true, if the same rays were traced before.
  [[nodiscard]] bool find_hits(uint32_t path, RayPacket& packet) {
    const Traced* known = find(path, kNotToLight);
    if (known == nullptr || (lane_bits(packet.valid) & ~known->lanes) != 0) return false;
    std::copy_n(known->distance, kPacket, packet.rays.ray.tfar);
    std::copy_n(known->geometry, kPacket, packet.rays.hit.geomID);
    std::copy_n(known->primitive, kPacket, packet.rays.hit.primID);
    return true;
  }
  void store_hits(uint32_t path, const RayPacket& packet) {
    Traced* entry = store(path, kNotToLight, lane_bits(packet.valid));
    if (entry == nullptr) return;
    std::copy_n(packet.rays.ray.tfar, kPacket, entry->distance);
    std::copy_n(packet.rays.hit.geomID, kPacket, entry->geometry);
    std::copy_n(packet.rays.hit.primID, kPacket, entry->primitive);
  }

 private:
  /// Added to the number of a light that is partly visible.
  static constexpr uint32_t kPartly = 0x1000;

  static uint32_t mixed(uint32_t path, uint32_t what) {
    uint32_t key = path * 0x9e3779b9U ^ (what + 1) * 0x85ebca6bU;
    key ^= key >> 15;
    key *= 0x2c1b3c6dU;
    return key ^ key >> 13;
  }

  static void record_shares(const KnownShare& shares, float* notes) {
    for (size_t r = 0; r < kPacket; ++r)
      notes[r] = (shares.lanes & kLaneBit[r]) != 0 ? shares.share[r] : LightRecord::kNoShare;
  }
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
  Traced* store(uint32_t path, uint32_t what, uint32_t lanes) {
    if (hits_ != Hits::Write) return nullptr;
    Traced& noted = traced_.emplace_back();
    noted.path = path;
    noted.what = what;
    noted.lanes = lanes;
    return &noted;
  }
  /// Finds the stored hits of a packet. All colours send the same rays in the same order, except
  /// rays with no weight in a colour: then stored packets are skipped, or lanes were not traced.
  const Traced* find(uint32_t path, uint32_t what) {
    if (hits_ != Hits::Read) return nullptr;
    const auto same = [&](const Traced& t) { return t.path == path && t.what == what; };
    const auto found =
        std::find_if(traced_.begin() + static_cast<std::ptrdiff_t>(passed_), traced_.end(), same);
    if (found == traced_.end()) return nullptr;
    passed_ = static_cast<size_t>(found - traced_.begin()) + 1;
    return &*found;
  }
  void store_share(uint32_t path, uint32_t what, const KnownShare& share) {
    if (Traced* entry = store(path, what, share.lanes))
      std::copy_n(share.share.data(), kPacket, entry->share);
  }
  /// Adds stored shares to the known ones, which keep precedence.
  void find_share(uint32_t path, uint32_t what, KnownShare& known) {
    if (const Traced* found = find(path, what))
      known.set(found->lanes & ~known.lanes, found->share);
  }

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
