// SPDX-License-Identifier: Apache-2.0
// PacketTracer traces the rays of a tile through the scene in packets of sixteen rays, with their
// shadow, mirrored and refracted rays.
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
  uint64_t ambient = 0;         ///< rays that sample occlusion and the environment
  uint64_t ambient_proved = 0;  ///< part of ambient that was culled: no geometry is near
  uint64_t invalid = 0;
  HoleCounts holes;
  uint64_t shadow_proved = 0;       ///< part of shadow that was culled: certainly unoccluded
  uint64_t shadow_blocked = 0;      ///< part of shadow that was culled: certainly occluded
  uint64_t secondary_proved = 0;    ///< part of secondary, culled: no hit
  uint64_t secondary_too_weak = 0;  ///< not traced: the light cannot change a code value
  uint64_t too_little = 0;          ///< not traced: see PacketTracer::tolerate()

  RayCounts& operator+=(const RayCounts& other);
  void report(RenderStatistics& statistics) const;
};

/// PacketTracer traces tiles of one scene. Thread safety: used by one thread. It keeps its memory
/// from tile to tile.
class PacketTracer {
 public:
  explicit PacketTracer(const RenderOptions& options);
  ~PacketTracer();
  PacketTracer(PacketTracer&&) noexcept;

  /// FootprintSample is one of the rays inside a subpixel's footprint: its number and its weight.
  struct FootprintSample {
    int number = 0;
    double weight = 1.0;
    DepthNotes* depths = nullptr;  ///< receives every packet, unless null
  };
  /// Adds the light of the primary rays of some columns of the tile that `maker` was started with
  /// to light[target], multiplied by the sample's weight; a ray's target is row * columns + column.
  /// `columns` begins and ends at multiples of eight. The order of additions depends on the rays
  /// only. The calling thread must flush denormals.
  void trace(const Scene& scene, const TilePlan& plan, const Tile& tile, ColumnRange columns,
             FootprintSample sample, PrimaryPackets::Maker& maker, std::span<float> light);

  /// Traces the valid lanes of one packet: lane r has colour channel[r] and its light goes to
  /// light[r]. Afterwards the packet holds its hits. Lanes may come from anywhere in a tile, but
  /// neighbouring lanes should be close together. The calling thread must flush denormals.
  void trace_lanes(const Scene& scene, const TilePlan& plan,
                   std::span<const int32_t, kPacket> channel, RayPacket& packet,
                   std::span<float, kPacket> light);
  /// Sets sampling::subpixel_seed() of the lanes of the following packets of trace_lanes() and the
  /// other functions for packets. Required if light is sampled (RenderOptions::soft).
  void set_seeds(std::span<const uint32_t, kPacket> seeds);
  [[nodiscard]] bool needs_seeds() const { return is_soft_; }

  /// Multiplies the number of rays for sampled light (RenderOptions::soft), for callers that trace
  /// few points and derive many subpixels from each. At least 1; the default is 1.
  void multiply_samples(int factor) { soft_.multiply_samples(factor); }
  /// See SoftShader::integrate_lamps(); the default is off.
  void integrate_lamps(bool integrate) { soft_.integrate_lamps(integrate); }

  /// Sets the allowed error per lane (for light sources no brighter than 1). Rays that can
  /// contribute less are not traced; half of their maximum contribution is added instead. 0, the
  /// default, disables this.
  void tolerate(float light) { tolerated_ = light; }

  /// Traces like trace_lanes(), fills notes() with the path records of the lanes, and stores all
  /// hits for trace_known(). Light below `noticed` does not affect the records.
  void trace_noting(const Scene& scene, const TilePlan& plan,
                    std::span<const int32_t, kPacket> channel, const SurfaceGroups& groups,
                    float noticed, RayPacket& packet, std::span<float, kPacket> light);

  /// Number of area lights whose visible shares are recorded.
  static constexpr size_t kLamps = 8;
  static constexpr float kNoShare = -1.0F;
  /// Notes are the path records of the lanes of the last trace_noting().
  struct Notes {
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
    alignas(64) float seen[kLamps][kPacket];
  };
  [[nodiscard]] const Notes& notes() const { return notes_; }

  /// Known holds the results for sixteen rays that need not be traced again.
  struct Known {
    static constexpr size_t kLights = 32;  ///< number of lights covered, starting with the first
    uint32_t lit[kLights];                 ///< bits of the lanes on which a light shines, by light,
    uint32_t hidden[kLights];              ///< and for each lane from which the light is hidden
    uint32_t secondary_lanes;  ///< lanes whose mirrored and refracted rays contribute `secondary`
    alignas(64) float secondary[kPacket];
    KnownShare around;        ///< see Notes
    KnownShare seen[kLamps];  ///< see Notes; used if area lights are integrated

    /// Sets `lit` and `hidden` from a bit mask of lights per lane, as in Notes.
    void set_lights(std::span<const uint32_t, kPacket> shining,
                    std::span<const uint32_t, kPacket> not_seen);
  };
  /// Shades like trace_lanes() a packet that already holds the hits of its primary rays. Shading is
  /// exact; `known` saves rays. Afterwards notes().secondary is valid, all other notes are not.
  /// `again` states that the packet is that of the last trace_noting() in another colour, so that
  /// its rays have the same hits.
  void trace_known(const Scene& scene, std::span<const int32_t, kPacket> channel,
                   const Known& known, RayPacket& packet, std::span<float, kPacket> light,
                   bool again = false);

  [[nodiscard]] RayCounts counts() const;
  [[nodiscard]] WorkClock& clock() { return clock_; }

 private:
  /// Generation holds the state of one bounce while the next bounce is traced.
  struct Generation;
  /// CellAnswers caches the cell results per thread, so that repeated queries cost almost nothing.
  struct CellAnswers {
    uint64_t number = ~uint64_t{0};
    uint32_t lights =
        0;  ///< two bits for each of the first lights: a ShaftProof, or zero if not queried
  };
  static constexpr size_t kLightsPerCell = 16;
  /// Cells holds the surface cells that a packet met, prepared for queries.
  struct Cells {
    shading_kernel::CellGroups groups;
    uint64_t numbers[kPacket];
  };
  void find_cells(const Scene& scene, const RayPacket& packet,
                  const shading_kernel::Surfaces& surfaces, Cells& cells);
  /// Payoff decides if culling queries are worthwhile: they are if they save the tracing of at
  /// least every other packet, or of fewer packets if one result saves several.
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
  /// Answer caches the last query, since neighbouring packets ask the same.
  struct Answer {
    uint64_t question = ~uint64_t{0};
    bool empty = false;
  };
  /// Asker is a packet with its surface cells.
  struct Asker {
    const RayPacket& packet;
    const Generation& generation;
  };
  /// Returns the lanes for which a light is known to be entirely visible or entirely hidden.
  KnownLanes known_lanes(const Scene& scene, const Asker& asker, size_t light, uint32_t wanted);
  ShaftProof light_proof(const Scene& scene, const Asker& asker, int group, size_t light);
  bool open(ShaftProofs& proofs, const Asker& asker, int group, uint64_t target);
  /// Lanes is the state of the packet that is being traced.
  struct Lanes {
    alignas(64) int32_t channel[kPacket];
    alignas(64) float backdrop[kPacket];  ///< flat backdrop light
    alignas(64) float light[kPacket];
    alignas(64) float leeway[kPacket];  ///< remaining allowed error
    uint32_t seed[kPacket] = {};        ///< used if light is sampled
    RTCRay16 shadow;
    alignas(64) int shadow_valid[kPacket];
  };

  /// Sets lanes invalid whose rays need not be traced; returns a bit mask of the culled lanes that
  /// meet nothing.
  uint32_t take_lit(const Scene& scene, const Asker& asker, size_t light, int* valid);
  uint32_t take_open(const Scene& scene, const Asker& asker, const shading_kernel::NewRays& rays,
                     int* valid);

  /// Traces the shadow rays of lanes_.shadow_valid; returns a bit mask of the unoccluded lanes.
  /// `coherence` is that of the packet before culling.
  uint32_t trace_shadows(const Scene& scene, size_t light, Coherence coherence, size_t depth);
  void trace_secondary(const Scene& scene, RayPacket& packet, Coherence coherence, size_t depth);
  /// Traced stores the hits of a packet, for reuse with the same rays.
  struct Traced {
    uint32_t path;   ///< sampling::longer_path() of the rays
    uint32_t what;   ///< light to which the rays went, or kNotToLight
    uint32_t lanes;  ///< bit mask of the traced lanes
    uint32_t free;   ///< bit mask of the lanes with an unoccluded light
    float distance[kPacket];
    uint32_t geometry[kPacket];
    uint32_t primitive[kPacket];
    float share[kPacket];  ///< visible share of a light, or of the hemisphere
  };
  static constexpr uint32_t kNotToLight = ~0U;
  static constexpr uint32_t kAllAround = ~1U;
  enum class Memory { Off, Writes, Reads };
  Traced* remember(uint32_t path, uint32_t what, uint32_t lanes);
  const Traced* recall(uint32_t path, uint32_t what);
  void remember_share(uint32_t path, uint32_t what, const KnownShare& share);
  void recall_share(uint32_t path, uint32_t what, KnownShare& known);

  /// Disables rays whose maximum contribution is below the tolerance and adds half of it.
  void leave_out_little(const shading_kernel::NewRays& rays, int* valid);
  /// Disables mirrored rays that cannot change the code value of their subpixel.
  void leave_out_weak(const Scene& scene, shading_kernel::NewRays& rays, size_t depth);

  /// Colour channels of a column's lanes, and the light they get from the backdrop.
  struct Colours;
  static Colours colours_of(const Scene& scene, const TilePlan& plan, const Tile& tile, int column);
  void seed_column(const TilePlan& plan, const Tile& tile, int column, int sample);
  static Colours colours_of(const Scene& scene, std::span<const int32_t, kPacket> channel);
  void set_colours(const Colours& colours);
  /// Traces a packet; its light is left in lanes_.light.
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
  /// Disables the lanes in which a light is known to be visible or known to be hidden; returns the
  /// visible lanes.
  uint32_t take_known(size_t light, int* valid) const;
  /// Adds the known light of mirrored and refracted rays; returns the weights without these lanes.
  const float* add_known_secondary(const float* weight);
  void add_backdrop(const Scene& scene, const RayPacket& packet, const float* weight,
                    uint32_t lanes);
  void add_soft_light(const Scene& scene, const Asker& asker, size_t light, const float* weight,
                      bool ask, size_t depth);
  /// Asking selects the culling queries to make.
  struct Asking {
    bool points = false;  ///< point lights
    bool lamps = false;   ///< area lights
    bool around = false;
    bool mirrored = false;
    [[nodiscard]] bool any() const { return points || lamps || around || mirrored; }
  };
  [[nodiscard]] Asking worth_asking(const Scene& scene, const shading_kernel::Surfaces& met);
  void add_lights(const Scene& scene, const Asker& asker, const float* weight, Asking ask,
                  size_t depth);
  void follow_glass(const Scene& scene, const RayPacket& packet, Generation& generation,
                    const float* weight, size_t depth);
  void follow(const Scene& scene, shading_kernel::NewRays& rays, RayPacket& packet,
              Coherence coherence, size_t depth, sampling::Turn turn);

  const shading_kernel::Kernel& kernel_;
  SoftShader soft_;
  bool is_soft_;
  ShaftProofs* soft_proofs_ = nullptr;  ///< the scene's cache for the sizes of the sampled lights
  std::vector<RayPacket> primary_;
  std::vector<Generation> generations_;
  Lanes lanes_;
  bool use_proofs_;
  bool skip_weak_;
  float tolerated_ = 0.0F;
  int glass_above_ = 0;                    ///< packets whose refracted rays are not traced yet
  const SurfaceGroups* groups_ = nullptr;  ///< groups of the surfaces in the notes
  float noticed_ = 0.0F;
  const Known* known_ = nullptr;
  Memory memory_ = Memory::Off;
  std::vector<Traced> traced_;  ///< ordered by time of tracing
  size_t recalled_ = 0;         ///< entries before this one are no longer needed
  Notes notes_;
  alignas(64) float weight_left_[kPacket];  ///< weights of primary rays with unknown secondary rays
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
