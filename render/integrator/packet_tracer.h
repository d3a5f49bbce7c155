// SPDX-License-Identifier: Apache-2.0
// Follows the rays of a tile through the scene, a packet of sixteen at a time, each with its shadow
// rays, its mirrored and its refracted rays.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "render/accel/ray_stream.h"
#include "render/culling/shaft_proofs.h"
#include "render/integrator/hole_guard.h"
#include "render/options/render_options.h"
#include "render/options/render_statistics.h"
#include "render/options/work_clock.h"
#include "render/rays/primary_packets.h"
#include "render/scene/scene.h"
#include "render/shading/shading_kernel.h"
#include "render/shading/soft_shader.h"

namespace lenticule::render {

class DepthNotes;
class SurfaceGroups;

struct RayCounts {
  uint64_t primary = 0;
  uint64_t secondary = 0;
  uint64_t shadow = 0;
  uint64_t ambient = 0;         ///< of sampled occlusion and surroundings
  uint64_t ambient_proved = 0;  ///< not traced: nothing was known to be near
  uint64_t invalid = 0;
  HoleCounts holes;
  uint64_t shadow_proved = 0;       ///< not traced: the way to the light was known to be free,
  uint64_t shadow_blocked = 0;      ///< or to be blocked
  uint64_t secondary_proved = 0;    ///< not traced: nothing was known to be in that direction
  uint64_t secondary_too_weak = 0;  ///< left out: their light cannot change a code value
  uint64_t too_little = 0;          ///< left out: see PacketTracer::tolerate()

  RayCounts& operator+=(const RayCounts& other);
  void report(RenderStatistics& statistics) const;
};

/// Of one thread and one scene; keeps its memory from tile to tile.
class PacketTracer {
 public:
  explicit PacketTracer(const RenderOptions& options);
  ~PacketTracer();
  PacketTracer(PacketTracer&&) noexcept;

  /// One of the rays inside a subpixel's footprint: its number, and the part that it has of all.
  struct FootprintSample {
    int number = 0;
    double weight = 1.0;
    DepthNotes* depths = nullptr;  ///< told of every packet, unless null
  };
  /// Adds to light[target] what the primary rays of some columns of the tile that `maker` was
  /// started with bring, each `weight` times; a ray's target is its row * columns + column. Columns
  /// begin and end at multiples of eight. Everything is added in an order that depends on the rays
  /// alone. Calling thread must flush denormals.
  void trace(const Scene& scene, const TilePlan& plan, const Tile& tile, ColumnRange columns,
             FootprintSample sample, PrimaryPackets::Maker& maker, std::span<float> light);

  /// The same for the valid lanes of one packet: lane r is of channel[r] and brings light[r], and
  /// the packet holds what it met. Lanes come from anywhere in a tile; neighbours should lie close
  /// together. Calling thread must flush denormals.
  void trace_lanes(const Scene& scene, const TilePlan& plan,
                   std::span<const int32_t, kPacket> channel, RayPacket& packet,
                   std::span<float, kPacket> light);
  /// sampling::subpixel_seed() of the lanes of the packets that follow, of trace_lanes() and its
  /// like; needed where light is sampled (RenderOptions::soft).
  void set_seeds(std::span<const uint32_t, kPacket> seeds);
  [[nodiscard]] bool needs_seeds() const { return is_soft_; }

  /// From now on, light that is sampled (RenderOptions::soft) takes that many times the rays; for
  /// those who trace few points and make many from each. At least 1, which it is at first.
  void multiply_samples(int factor) { soft_.multiply_samples(factor); }
  /// See SoftShader; off at first.
  void integrate_lamps(bool integrate) { soft_.integrate_lamps(integrate); }

  /// From now on the light of a lane may be off by that much, if what shines into the scene is no
  /// brighter than white: rays that bring little are not traced, and half of what they could bring
  /// is added. 0, which it is at first, traces all.
  void tolerate(float light) { tolerated_ = light; }

  /// And notes() tells afterwards which way each lane's light came. Less light than `noticed` makes
  /// no difference to that. What rays met is remembered for trace_known().
  void trace_noting(const Scene& scene, const TilePlan& plan,
                    std::span<const int32_t, kPacket> channel, const SurfaceGroups& groups,
                    float noticed, RayPacket& packet, std::span<float, kPacket> light);

  /// Lights whose shares are told.
  static constexpr size_t kLamps = 8;
  static constexpr float kNoShare = -1.0F;
  /// How a lane's light came, of the last trace_noting().
  struct Notes {
    /// Numbers for the surfaces met and the lights hidden from them, as far as they could matter:
    /// equal where nothing differs. Of the ray itself, and of those that it was mirrored or
    /// refracted into.
    alignas(64) uint32_t way[kPacket];
    alignas(64) uint32_t secondary_way[kPacket];
    /// What those brought; part of the lane's light.
    alignas(64) float secondary[kPacket];
    /// Of each of the first 32 lights a bit: it shines on the surface that the ray met itself, or
    /// something is in its way. Neither where it is behind.
    /// Of a lamp with a size: all of it, none of it, or neither.
    alignas(64) uint32_t lit[kPacket];
    alignas(64) uint32_t hidden[kPacket];
    /// Part of all directions that are free, where occlusion is sampled; kNoShare on surfaces that
    /// reflect no such light.
    alignas(64) float around[kPacket];
    /// Of the first lamps with a size the share of their light that reaches a lane's surface;
    /// kNoShare where they would not shine on it anyway.
    alignas(64) float seen[kLamps][kPacket];
  };
  [[nodiscard]] const Notes& notes() const { return notes_; }

  /// What need not be traced of sixteen rays.
  struct Known {
    static constexpr size_t kLights = 32;  ///< the first
    uint32_t lit[kLights];                 ///< by light: lanes on which it shines, a bit each,
    uint32_t hidden[kLights];              ///< and those from which it is hidden
    uint32_t secondary_lanes;              ///< whose mirrored and refracted rays bring `secondary`
    alignas(64) float secondary[kPacket];
    KnownShare around;        ///< as in Notes
    KnownShare seen[kLamps];  ///< the same; used where lamps are integrated

    /// By lane, a bit for each light, as in Notes.
    void set_lights(std::span<const uint32_t, kPacket> shining,
                    std::span<const uint32_t, kPacket> not_seen);
  };
  /// As trace_lanes() for a packet that holds what its rays met first. Shading is exact; `known`
  /// saves rays. Afterwards notes().secondary is right, other notes mean nothing. `again`: the
  /// packet is that of the last trace_noting(), in another colour, whose rays meet the same.
  void trace_known(const Scene& scene, std::span<const int32_t, kPacket> channel,
                   const Known& known, RayPacket& packet, std::span<float, kPacket> light,
                   bool again = false);

  [[nodiscard]] RayCounts counts() const;
  [[nodiscard]] WorkClock& clock() { return clock_; }

 private:
  /// What is needed of one generation of rays while the next is followed.
  struct Generation;
  /// What is known of a cell; of each thread, so that asking again costs next to nothing.
  struct CellAnswers {
    uint64_t number = ~uint64_t{0};
    uint32_t lights =
        0;  ///< two bits for each of the first: a ShaftProof, or zero if not asked yet
  };
  static constexpr size_t kLightsPerCell = 16;
  /// The cells that a packet met, ready to be asked about.
  struct Cells {
    shading_kernel::CellGroups groups;
    uint64_t numbers[kPacket];
  };
  void find_cells(const Scene& scene, const RayPacket& packet,
                  const shading_kernel::Surfaces& surfaces, Cells& cells);
  /// Whether asking for proofs pays: it does if every other packet need not be traced at all, or
  /// fewer where one answer saves several.
  class Payoff {
   public:
    explicit Payoff(uint32_t packets_per_answer = 1) : per_answer_(packets_per_answer) {}
    [[nodiscard]] bool worth_asking();
    void asked(bool packet_saved);

   private:
    uint32_t per_answer_;
    uint32_t asked_ = 0;
    uint32_t saved_ = 0;
    uint32_t pause_ = 0;
    uint32_t next_pause_ = 64;
  };
  /// Neighbouring packets ask the same: the answers to what was asked last.
  struct Answer {
    uint64_t question = ~uint64_t{0};
    bool empty = false;
  };
  /// A packet, and the cells that it met.
  struct Asker {
    const RayPacket& packet;
    const Generation& generation;
  };
  /// Lanes from which all of a light, or nothing of it, is known to be seen.
  KnownLanes known_lanes(const Scene& scene, const Asker& asker, size_t light, uint32_t wanted);
  ShaftProof light_proof(const Scene& scene, const Asker& asker, int group, size_t light);
  bool open(ShaftProofs& proofs, const Asker& asker, int group, uint64_t target);
  /// Of the packet that is being traced.
  struct Lanes {
    alignas(64) int32_t channel[kPacket];
    alignas(64) float backdrop[kPacket];  ///< where it is flat
    alignas(64) float light[kPacket];
    alignas(64) float leeway[kPacket];  ///< that it may still be off by
    uint32_t seed[kPacket] = {};        ///< where light is sampled
    RTCRay16 shadow;
    alignas(64) int shadow_valid[kPacket];
  };

  /// Make lanes invalid whose rays need not be traced; return those that meet nothing, a bit each.
  uint32_t take_lit(const Scene& scene, const Asker& asker, size_t light, int* valid);
  uint32_t take_open(const Scene& scene, const Asker& asker, const shading_kernel::NewRays& rays,
                     int* valid);

  /// Of the lanes of lanes_.shadow_valid, those whose way to a light is free; a bit each.
  uint32_t trace_shadows(const Scene& scene, size_t light, size_t depth);
  void trace_secondary(const Scene& scene, RayPacket& packet, size_t depth);
  /// What a packet of rays met, to be used once more for the same rays.
  struct Traced {
    uint32_t path;   ///< sampling::longer_path() of the rays, and
    uint32_t what;   ///< the light that they went to, or kNotToLight
    uint32_t lanes;  ///< a bit each
    uint32_t free;   ///< lanes whose way to a light was free
    float distance[kPacket];
    uint32_t geometry[kPacket];
    uint32_t primitive[kPacket];
    float share[kPacket];  ///< of a lamp, or of free directions
  };
  static constexpr uint32_t kNotToLight = ~0U;
  static constexpr uint32_t kAllAround = ~1U;
  enum class Memory { Off, Writes, Reads };
  Traced* remember(uint32_t path, uint32_t what, uint32_t lanes);
  const Traced* recall(uint32_t path, uint32_t what);
  void remember_share(uint32_t path, uint32_t what, const KnownShare& share);
  void recall_share(uint32_t path, uint32_t what, KnownShare& known);

  /// Makes rays invalid that bring so little that half of it will do, and adds that.
  void leave_out_little(const shading_kernel::NewRays& rays, int* valid);
  /// Makes mirrored rays invalid that cannot change the code value of their subpixel.
  void leave_out_weak(const Scene& scene, shading_kernel::NewRays& rays, size_t depth);

  /// The channels of a column's lanes, and what they see where there is nothing.
  struct Colours;
  static Colours colours_of(const Scene& scene, const TilePlan& plan, const Tile& tile, int column);
  void seed_column(const TilePlan& plan, const Tile& tile, int column, int sample);
  static Colours colours_of(const Scene& scene, std::span<const int32_t, kPacket> channel);
  void set_colours(const Colours& colours);
  /// Leaves the light of the lanes in lanes_.light.
  void trace_packet(const Scene& scene, double row_mm, const Colours& colours, const float* weight,
                    RayPacket& packet);
  void shade(const Scene& scene, const RayPacket& packet, const float* weight, size_t depth);
  void add_own_light(const Scene& scene, const Asker& asker, const float* weight, bool ask,
                     size_t depth);
  [[nodiscard]] SoftPacket soft_packet(const Scene& scene, const Generation& generation) const;
  void note_surfaces(const RayPacket& packet, const shading_kernel::Surfaces& surfaces,
                     const float* weight, size_t depth);
  void note_shadows(const float* brings, uint32_t wanted, uint32_t reached, size_t light,
                    size_t depth);
  void note_lamp(const LampSeen& seen, size_t light, size_t depth);
  static void note_shares(const KnownShare& shares, float* notes);
  void note_secondary();
  /// Lanes that are known to be lit, without tracing them or those that are known not to be.
  uint32_t take_known(size_t light, int* valid) const;
  /// Without the lanes whose mirrored and refracted rays are known; their light is added.
  const float* add_known_secondary(const float* weight);
  void add_backdrop(const Scene& scene, const RayPacket& packet, const float* weight,
                    uint32_t lanes);
  void add_soft_light(const Scene& scene, const Asker& asker, size_t light, const float* weight,
                      bool ask, size_t depth);
  /// What to ask for proofs about.
  struct Asking {
    bool points = false;  ///< lights without
    bool lamps = false;   ///< and with a size
    bool around = false;
    bool mirrored = false;
    [[nodiscard]] bool any() const { return points || lamps || around || mirrored; }
  };
  [[nodiscard]] Asking worth_asking(const Scene& scene, const shading_kernel::Surfaces& met);
  void add_lights(const Scene& scene, const Asker& asker, const float* weight, Asking ask,
                  size_t depth);
  void follow_glass(const Scene& scene, const RayPacket& packet, Generation& generation,
                    const float* weight, size_t depth);
  void follow(const Scene& scene, shading_kernel::NewRays& rays, RayPacket& packet, size_t depth,
              sampling::Turn turn);

  const shading_kernel::Kernel& kernel_;
  SoftShader soft_;
  bool is_soft_;
  ShaftProofs* soft_proofs_ = nullptr;  ///< of the scene, with the sizes of what is sampled
  std::vector<RayPacket> primary_;
  std::vector<Generation> generations_;
  Lanes lanes_;
  bool use_proofs_;
  bool skip_weak_;
  float tolerated_ = 0.0F;
  int glass_above_ = 0;                    ///< packets whose refracted rays are still to come
  const SurfaceGroups* groups_ = nullptr;  ///< of what is noted
  float noticed_ = 0.0F;
  const Known* known_ = nullptr;
  Memory memory_ = Memory::Off;
  std::vector<Traced> traced_;  ///< in the order of tracing
  size_t recalled_ = 0;         ///< those before are of no more use
  Notes notes_;
  alignas(64) float weight_left_[kPacket];  ///< of primary rays whose secondary ones are not known
  static constexpr unsigned kAnswersLog2 = 10;
  std::vector<CellAnswers> cells_;
  std::vector<Answer> answers_;
  Payoff shadow_payoff_;
  Payoff lamp_payoff_;
  Payoff around_payoff_;
  Payoff mirrored_payoff_;
  RayCounts counts_;
  WorkClock clock_;
};

}  // namespace lenticule::render
