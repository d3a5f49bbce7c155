// SPDX-License-Identifier: Apache-2.0
// CellCulling finds the rays of a packet that need not be traced: it asks the shaft tests
// (render/culling/shaft_cache.h) for the surface cells that the packet met.
#pragma once

#include <cstdint>
#include <vector>

#include "render/culling/shaft_cache.h"
#include "render/options/render_options.h"
#include "render/scene/scene.h"
#include "render/shading/shading_kernel.h"
#include "render/shading/soft_shader.h"

namespace lenticule::render {

/// CellCulling serves one scene. All results are certain: the bytes of a frame do not depend on
/// them. Thread safety: used by one thread.
class CellCulling {
 public:
  CellCulling(const RenderOptions& options, const SoftShader& soft);

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
  void look_at(const Scene& scene, const RayPacket& packet,
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
  bool samples_area_lights_;
  bool looks_around_;
  SoftSizes sizes_;
  ShaftCache* soft_cache_ = nullptr;  ///< the scene's cache for the sizes of sampled lights
  static constexpr unsigned kAnswersLog2 = 10;
  std::vector<LightAnswers> light_answers_;
  std::vector<OpenAnswer> open_answers_;
  Payoff point_payoff_;
  Payoff area_light_payoff_;
  Payoff around_payoff_;
  Payoff mirrored_payoff_;
};

}  // namespace lenticule::render
