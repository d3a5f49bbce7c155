// SPDX-License-Identifier: Apache-2.0
// PacketTracer traces the rays of a tile through the scene in packets of sixteen rays, with their
// shadow, mirrored and refracted rays. Method adaptive uses it through RecordingTracer.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "render/accel/ray_stream.h"
#include "render/culling/shaft.h"
#include "render/options/render_options.h"
#include "render/rays/primary_packets.h"
#include "render/rays/primary_rays.h"
#include "render/scene/scene.h"
#include "render/shading/shading_kernel.h"
#include "render/shading/soft_shader.h"

namespace lenticule::render {

// Crack filter: finds and fills the pinholes that single precision leaves at the corners of meshes.
//
// Embree decides consistently which of two triangles with a common edge a ray hits. Where many
// triangles meet in a corner, a ray that passes exactly through the corner can miss all of them.

/// Examines a packet of neighbouring rays that Embree has just traced, and repairs the hits of rays
/// that passed through a pinhole. A ray is examined if it continues past the hits of its
/// neighbours. Four rays at a tiny distance around it are traced, and all must end much sooner than
/// the ray. The ray gets its own hit if it ends as soon when traced alone; otherwise the hit of one
/// of the four, if it passes a corner within the rounding of single precision. The result depends
/// on the packet and the scene only. Counts suspected and filled holes.
///
/// `step_mm` is the distance between neighbouring rays. The calling thread must flush denormals.
void fill_holes(const Scene& scene, double step_mm, RayPacket& packet, FrameCounts& counts);

/// DepthRecorder records depths for one scene. Thread safety: used by one thread.
class DepthRecorder {
 public:
  explicit DepthRecorder(const Scene& scene);

  /// Begins a tile; all depths are reset to -infinity.
  void start(const Tile& tile);
  /// Records the hits of a column's packet after tracing.
  void note(int column, const RayPacket& packet);

  /// Returns panel z by row * columns + column, in millimetres; -infinity for rays that met
  /// nothing.
  [[nodiscard]] std::span<const float> z_mm() const { return z_mm_; }

 private:
  Vec3f z_of_scene_;  ///< gradient and origin of panel z in the scene frame
  float z_at_origin_;
  size_t columns_ = 0;
  std::vector<float> z_mm_;
};

/// CellCulling finds the rays of a packet that need not be traced: it asks the shaft tests
/// (render/culling/shaft.h) for the surface cells that the packet met. It serves one scene. All
/// results are certain: the bytes of a frame do not depend on them. Thread safety: used by one
/// thread.
class CellCulling {
 public:
  explicit CellCulling(const RenderOptions& options);

  /// Cells holds the surface cells that a packet met, and which kinds of queries are worthwhile.
  struct Cells {
    bool point_lights = false;
    bool area_lights = false;
    bool around = false;
    bool mirrored = false;
    // Valid if any of the above is true:
    const RayPacket* packet = nullptr;
    const shading_kernel::Surfaces* surfaces = nullptr;
    shading_kernel::CellGroups groups;
    uint64_t numbers[kPacket];
  };
  /// Decides which queries to make for a packet, and finds its cells if there are any. Lifetime:
  /// packet and surfaces must outlive the queries.
  void look_at(const Scene& scene, const SoftShader& soft, const RayPacket& packet,
               const shading_kernel::Surfaces& surfaces, Cells& cells);

  // Each query takes and returns bit masks of lanes. If its kind is not worthwhile, nothing is
  // known.

  /// Returns the lanes of `wanted` from which a point light is known to be visible or hidden.
  KnownLanes point_light(const Scene& scene, const Cells& cells, size_t light, uint32_t wanted);
  /// The same for the whole of an area light.
  KnownLanes area_light(const Cells& cells, size_t light, uint32_t wanted);
  /// Returns the lanes around which there is certainly no geometry.
  uint32_t open_around(const Cells& cells);
  /// Returns the lanes of `wanted` whose mirrored rays certainly meet nothing.
  uint32_t open_mirrored(const Scene& scene, const Cells& cells,
                         const shading_kernel::NewRays& rays, uint32_t wanted);

 private:
  /// Payoff decides if queries are worthwhile: they are if they save the tracing of at least every
  /// other packet, or of fewer packets if one result saves several.
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
  /// LightAnswers caches the results of a cell per thread, so that repeated queries cost almost
  /// nothing: two bits for each of the first lights, a ShaftResult, or zero if not queried.
  struct LightAnswers {
    uint64_t cell = ~uint64_t{0};
    uint32_t lights = 0;
  };
  static constexpr size_t kLightsPerCell = 16;
  /// OpenAnswer caches the last query, since neighbouring packets ask the same.
  struct OpenAnswer {
    uint64_t question = ~uint64_t{0};
    bool empty = false;
  };

  KnownLanes known_lanes(ShaftCache& shaft_cache, const Cells& cells, size_t light,
                         uint32_t wanted);
  ShaftResult light_result(ShaftCache& shaft_cache, const Cells& cells, int group, size_t light);
  bool open(ShaftCache& shaft_cache, const Cells& cells, int group, uint64_t target);

  const shading_kernel::Kernel& kernel_;
  bool enabled_;
  ShaftCache* soft_cache_ = nullptr;  ///< the scene's cache for the sizes of sampled lights
  static constexpr unsigned kAnswersLog2 = 10;
  std::vector<LightAnswers> light_answers_;
  std::vector<OpenAnswer> open_answers_;
  Payoff point_payoff_;
  Payoff area_light_payoff_;
  Payoff around_payoff_;
  Payoff mirrored_payoff_;
};

class LightCache;
class PbrTracer;

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
    DepthRecorder* depths = nullptr;  ///< receives every packet, unless null
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
  /// See SoftShader::integrate_area_lights(); the default is off.
  void integrate_area_lights(bool integrate) { soft_.integrate_area_lights(integrate); }

  /// Sets the allowed error per lane (for light sources no brighter than 1). Rays that can
  /// contribute less are not traced; half of their maximum contribution is added instead. 0, the
  /// default, disables this.
  void tolerate(float light) { tolerated_ = light; }

  /// Returns the counters of rays; those of subpixels are 0.
  [[nodiscard]] FrameCounts counts() const;
  [[nodiscard]] WorkClock& clock() { return clock_; }

 protected:
  /// Sets the cache that the following packets use; null for none.
  void use(LightCache* cache) { cache_ = cache; }
  /// Shades like trace_lanes() a packet that already holds the hits of its rays.
  void shade_lanes(const Scene& scene, const TilePlan& plan,
                   std::span<const int32_t, kPacket> channel, const RayPacket& packet,
                   std::span<float, kPacket> light);
  /// Returns the light, in any channel, of the last packet, whose scene has metallic-roughness
  /// materials. Lanes that met nothing have the light of their own channel.
  [[nodiscard]] std::array<float, kPacket> pbr_light(const RayPacket& packet, int channel) const;

 private:
  /// Generation holds the state of one bounce while the next bounce is traced.
  struct Generation;
  /// Lanes is the state of the packet that is being traced.
  struct Lanes {
    alignas(64) int32_t channel[kPacket];
    alignas(64) float backdrop[kPacket];  ///< flat backdrop light
    alignas(64) float light[kPacket];
    alignas(64) float tolerance_left[kPacket];  ///< remaining allowed error
    uint32_t seed[kPacket] = {};                ///< used if light is sampled
    RTCRay16 shadow;
    alignas(64) int shadow_valid[kPacket];
  };
  /// Colour channels of a column's lanes, and the light they get from the backdrop.
  struct Colours;

  static Colours colours_of(const Scene& scene, const TilePlan& plan, const Tile& tile, int column);
  static Colours colours_of(const Scene& scene, std::span<const int32_t, kPacket> channel);
  void set_colours(const Colours& colours);
  void seed_column(const TilePlan& plan, const Tile& tile, int column, int sample);
  /// Traces a packet; its light is left in lanes_.light.
  void trace_packet(const Scene& scene, const TilePlan& plan, const Colours& colours,
                    const float* weight, RayPacket& packet);
  /// Does what shade() does for primary rays, in a scene of metallic-roughness materials.
  void shade_pbr(const Scene& scene, const TilePlan& plan, const RayPacket& packet,
                 const float* weight);

  // `depth` is the number of bounces before the rays that met the surfaces; `weight` is the factor
  // of each lane's light.

  /// Adds the light of rays that have been traced: of the surfaces they met, and of secondary rays.
  void shade(const Scene& scene, const RayPacket& packet, const float* weight, size_t depth);
  void add_backdrop(const Scene& scene, const RayPacket& packet, const float* weight,
                    uint32_t lanes);
  void add_own_light(const Scene& scene, const float* weight, size_t depth);
  void add_lights(const Scene& scene, const float* weight, size_t depth);
  void add_soft_light(const Scene& scene, size_t light, const float* weight, size_t depth);
  [[nodiscard]] SoftPacket soft_packet(const Scene& scene, size_t depth) const;
  /// Traces the shadow rays of lanes_.shadow_valid; returns a bit mask of the unoccluded lanes.
  /// `coherence` is that of the packet before culling.
  uint32_t trace_shadows(const Scene& scene, size_t light, Coherence coherence, size_t depth);

  /// Makes the mirrored rays of a bounce; returns false if there are none.
  bool mirror(Generation& generation, const float* weight);
  void follow_mirror(const Scene& scene, const float* weight, size_t depth);
  void follow_glass(const Scene& scene, const RayPacket& packet, const float* weight, size_t depth);
  void follow(const Scene& scene, shading_kernel::NewRays& rays, RayPacket& packet,
              Coherence coherence, size_t depth, sampling::Turn turn);
  void trace_secondary(const Scene& scene, RayPacket& packet, Coherence coherence, size_t depth);
  /// Disables rays whose maximum contribution is below the tolerance and adds half of it.
  void leave_out_little(const shading_kernel::NewRays& rays, int* valid);
  /// Disables mirrored rays that cannot change the code value of their subpixel.
  void leave_out_weak(const Scene& scene, shading_kernel::NewRays& rays, size_t depth);

  Isa isa_;
  const shading_kernel::Kernel& kernel_;
  SoftShader soft_;
  CellCulling culling_;
  bool is_soft_;
  bool skip_weak_;
  float tolerated_ = 0.0F;
  int glass_above_ = 0;  ///< packets whose refracted rays are not traced yet
  std::vector<RayPacket> primary_;
  std::vector<Generation> generations_;
  Lanes lanes_;
  std::unique_ptr<PbrTracer> pbr_;  ///< created when needed
  LightCache* cache_ = nullptr;     ///< null unless a RecordingTracer traces
  FrameCounts counts_;
  WorkClock clock_;
};

}  // namespace lenticule::render
