// SPDX-License-Identifier: Apache-2.0
// LightMemory is what method adaptive adds to the tracing of a packet: it notes how the light of
// each lane came about, and supplies light and hits that are known already. PacketTracer calls it
// while it traces for a NotingTracer, and has none in all other methods.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "render/integrator/light_notes.h"
#include "render/scene/surface_groups.h"
#include "render/shading/shading_kernel.h"
#include "render/shading/soft_shader.h"

namespace lenticule::render {

/// LightMemory serves one packet at a time: begin_...(), calls of the tracer, end(). Thread safety:
/// used by one thread. It keeps its memory from packet to packet.
class LightMemory {
 public:
  // ---- for NotingTracer

  /// Begins the notes of a packet and the record of its hits. Light below `noticed` does not affect
  /// the notes. Lifetime: `groups` must live until end().
  void begin_noting(const SurfaceGroups& groups, float noticed);
  /// Begins a packet whose light is partly known. `again` states that its rays are those of the
  /// last begin_noting() in another colour. Lifetime: `known` must live until end().
  void begin_known(const KnownLight& known, bool again);
  /// Ends a packet; `light` is the light of its lanes.
  void end(const float* light);
  [[nodiscard]] const LightNotes& notes() const { return notes_; }

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

  void note_surfaces(Bounce bounce, const RayPacket& packet,
                     const shading_kernel::Surfaces& surfaces, const float* weight);

  /// Notes the surface that a lane met; `how` tells the ways of meeting it apart.
  void note_surface(Bounce bounce, size_t lane, uint32_t geometry, uint32_t primitive,
                    uint32_t how);

  /// Returns the lanes whose unoccluded share of the hemisphere is known.
  [[nodiscard]] KnownShare known_around(Bounce bounce);
  /// Notes the share of the hemisphere; `serves_all_colours` if the other colours have the same.
  void keep_around(Bounce bounce, const KnownShare& share, bool serves_all_colours);

  /// Sets the lanes of `valid` to invalid in which a light is known to be visible or hidden;
  /// returns those in which it is visible.
  uint32_t take_known(Bounce bounce, size_t light, int* valid) const;
  /// Returns the lanes that the light reaches, if the same shadow rays were traced before.
  [[nodiscard]] std::optional<uint32_t> recall_shadows(Bounce bounce, size_t light, uint32_t lanes);
  void remember_shadows(Bounce bounce, size_t light, uint32_t lanes, uint32_t unoccluded);
  /// Notes the shadows of a light. Only shadows from lights in front of a surface that contribute
  /// noticeably matter; `brings` is the light of each lane if unoccluded.
  void note_shadows(Bounce bounce, size_t light, const float* brings, uint32_t wanted,
                    uint32_t reached);
  /// Notes lanes that a part of a light reaches.
  void note_partly(Bounce bounce, size_t light, uint32_t lanes);

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
  [[nodiscard]] bool recall_hits(uint32_t path, RayPacket& packet);
  void remember_hits(uint32_t path, const RayPacket& packet);

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
  Traced* remember(uint32_t path, uint32_t what, uint32_t lanes);
  const Traced* recall(uint32_t path, uint32_t what);
  void remember_share(uint32_t path, uint32_t what, const KnownShare& share);
  void recall_share(uint32_t path, uint32_t what, KnownShare& known);

  LightNotes notes_;
  const SurfaceGroups* groups_ = nullptr;  ///< groups of the surfaces in the notes
  float noticed_ = 0.0F;
  const KnownLight* known_ = nullptr;
  enum class Hits { Off, Write, Read } hits_ = Hits::Off;
  std::vector<Traced> traced_;              ///< ordered by time of tracing
  size_t recalled_ = 0;                     ///< entries before this one are no longer needed
  alignas(64) float weight_left_[kPacket];  ///< weights of primary rays with unknown secondary rays
};

}  // namespace lenticule::render
