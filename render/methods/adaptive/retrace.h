// SPDX-License-Identifier: Apache-2.0
// Shading of the subpixels that the cache views do not settle. ColourTracer takes the samples: it
// traces sixteen rays in all three colours and records the paths of their light. LightResolver
// compares the records of the samples around a subpixel: light on which they agree need not be
// traced again. UncertainSubpixels shades the subpixels of a band in packets with what is left.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "render/integrator/light_cache.h"
#include "render/methods/adaptive/key_samples.h"
#include "render/rays/primary_rays.h"
#include "render/row_sweep/row_planes.h"
#include "render/scene/surface_groups.h"

namespace lenticule::render {

/// ColourTracer belongs to one thread.
class ColourTracer {
 public:
  ColourTracer(const RenderOptions& options, const TilePlan& plan)
      : tracer_(options), plan_(plan) {}

  struct Colours {
    alignas(64) float light[3][kPacket];
    float secondary[3][kPacket];  ///< part of `light` from mirrored and refracted rays
    uint32_t group[kPacket];
    LightRecord notes;  ///< path records of the green channel
  };
  /// Traces the valid lanes of the packet, which holds the hits afterwards, see RecordingTracer.
  /// Light below `noticed` does not affect the notes.
  void trace(const Scene& scene, const SurfaceGroups& groups, float noticed, RayPacket& packet,
             Colours& out);

  [[nodiscard]] RecordingTracer& tracer() { return tracer_; }

 private:
  RecordingTracer tracer_;
  const TilePlan& plan_;
};

/// ResolvedAreaLights holds the known visible shares of a subpixel's area lights.
struct ResolvedAreaLights {
  std::array<uint16_t, LightRecord::kAreaLights> seen{};  ///< unit 1 / kWholeAreaLight
  std::array<uint16_t, LightRecord::kAreaLights>
      apart{};  ///< spread of the samples, in the same unit

  static constexpr int kWholeAreaLight = 256 * KeySamples::Light::kWholeAreaLight;
};

/// ResolvedLight is small, since millions are sorted; so area lights are stored separately.
struct ResolvedLight {
  uint32_t lit = 0, hidden = 0;  ///< bits of LightRecord on which all samples agree
  float secondary = 0.0F;        ///< valid if secondary_known
  float around = 0.0F;           ///< unoccluded share of the hemisphere; valid if around_known
  uint32_t area_lights = 0;      ///< index of its ResolvedAreaLights, if any area light is known
  bool secondary_known = false;
  bool around_known = false;
  uint8_t area_lights_known = 0;  ///< a bit for each area light whose share is known

  /// Purpose of the sample rays needed: the first unknown area light, or one of the constants
  /// below.
  uint8_t wanted = kNoSamples;

  static constexpr uint8_t kAllSamples =
      LightRecord::kAreaLights;  ///< ambient, or too little known
  static constexpr uint8_t kNoSamples = LightRecord::kAreaLights + 1;
  static_assert(LightRecord::kAreaLights <= 8, "a bit for each lamp");
};

/// LightResolver decides, from the nearest samples, which light of a subpixel of a frame needs no
/// rays of its own. Thread safety: used by one thread. The result for the four samples around a
/// cell is computed once for all subpixels that look up this cell.
class LightResolver {
 public:
  /// Lifetime: `samples` and `grid` must outlive the object and must not change. `soft` selects the
  /// sampled light.
  LightResolver(const KeySamples& samples, const KeyGrid& grid, const Tolerances& tolerances,
                bool colour_managed, const SoftLight& soft);

  /// Position of a point in a view next to the subpixel's own, see lookup_kernel::Found.
  struct Place {
    int cell;      ///< -1 outside
    float part;    ///< weight of the cell's right column
    float weight;  ///< weight of the view
    size_t odd;    ///< 1 for views with odd numbers
  };
  struct Point {
    KeyGrid::Between rows;
    std::array<Place, 2> places;
    uint32_t group;  ///< the surface seen
    int channel;
  };
  /// Resolves the light of a point. Only samples that show its surface are used; if there are too
  /// few, nothing is resolved. Appends an element to `area_lights` if shares of area lights are
  /// known.
  void resolve(const Point& point, ResolvedLight& out,
               std::vector<ResolvedAreaLights>& area_lights);
  /// Returns true if no sample around the point changed (KeySamples::cell_changed).
  [[nodiscard]] bool is_as_before(const KeyGrid::Between& rows,
                                  const std::array<Place, 2>& places) const;

 private:
  /// Number of corners on which an area light would shine, and the range of its visible shares
  /// there.
  struct AreaLights {
    std::array<uint8_t, LightRecord::kAreaLights> count{}, least, most{};

    AreaLights() { least.fill(KeySamples::Light::kNotShining); }
    void add(const KeySamples::Light& light);
    void add(const AreaLights& other);
  };
  /// Values on which the corners of a cell that show a given surface agree.
  struct Corners {
    static constexpr float kMost = std::numeric_limits<float>::infinity();
    uint32_t group = 0;
    int row = -1;  ///< row of the upper two corners
    int count = 0;
    bool same_way = true;
    uint32_t way = 0;
    uint32_t lit = ~0U, hidden = ~0U;
    std::array<float, 3> low{kMost, kMost, kMost}, high{-kMost, -kMost, -kMost};
    float least_around = 1.0F, most_around = 0.0F;

    void add(const KeySamples::Light& light);
    void add(const Corners& other);
  };
  const Corners& corners_of(const Point& point, const Place& place);
  /// Calls `use(index, weight)` for each corner of a cell.
  template <class Use>
  void each_corner(const Point& point, const Place& place, const Use& use) const;
  [[nodiscard]] ResolvedAreaLights resolve_area_lights(const Point& point,
                                                       ResolvedLight& out) const;
  void blend(const Point& point, ResolvedLight& out) const;
  void blend_area_lights(const Point& point, ResolvedAreaLights& out) const;

  const KeySamples& samples_;
  const KeyGrid& grid_;
  Tolerances tolerances_;
  bool colour_managed_, finds_around_, finds_area_lights_;
  std::vector<Corners> cached_;                 ///< indexed by place in a row of samples
  std::vector<AreaLights> cached_area_lights_;  ///< the same for area lights, if resolved
};

/// UncertainSubpixels collects the subpixels of a band of rows that must be shaded individually,
/// row by row, and traces them in packets of neighbours. It belongs to one thread and keeps its
/// memory from band to band.
class UncertainSubpixels {
 public:
  struct Subpixel {
    int32_t at = 0;    ///< 3 i + channel
    uint16_t row = 0;  ///< index in the band
    float x_mm = 0.0F, tan_x = 0.0F;
    float light = 0.0F;  ///< result of tracing
    // Valid only if the surface is known:
    float z_mm = 0.0F;
    uint32_t geometry = 0, primitive = 0, group = 0;
    ResolvedLight resolved{};
  };

  /// Lifetime: `planes` and `plan` must outlive the object.
  UncertainSubpixels(const RowPlanes& planes, const TilePlan& plan);

  void clear() {
    subpixels_.clear();
    area_lights_.clear();
  }
  void add(const Subpixel& subpixel) { subpixels_.push_back(subpixel); }
  /// Adds a subpixel to be filled in place, since a copy would stall on recent writes.
  [[nodiscard]] Subpixel& add() { return subpixels_.emplace_back(); }
  /// Returns the list that ResolvedLight::area_lights indexes.
  [[nodiscard]] std::vector<ResolvedAreaLights>& area_lights() { return area_lights_; }

  /// Shades all subpixels on their known surfaces, and traces the light that is not resolved. Rows
  /// are counted from `first_row`. Afterwards the subpixels have a different order. The calling
  /// thread must flush denormals.
  void shade(const Scene& scene, double start_mm, int first_row, RecordingTracer& tracer);
  [[nodiscard]] const std::vector<Subpixel>& subpixels() const { return subpixels_; }

 private:
  void order();
  void find_planes(int first_row);
  void load(const Scene& scene, double start_mm, size_t first);
  void find_seeds(int first_row, size_t first);
  void load_surfaces(const Scene& scene, double start_mm, size_t first);

  const RowPlanes& planes_;
  const TilePlan& plan_;
  std::array<RowPlane, TilePlan::kRows> plane_of_row_{};  ///< plane of each row of the band
  std::vector<Subpixel> subpixels_, ordered_;
  std::vector<ResolvedAreaLights> area_lights_;
  std::vector<uint32_t> first_of_column_;
  std::vector<RayPacket> packet_;  ///< a single packet
  alignas(64) std::array<int32_t, kPacket> channel_{};
  std::array<uint32_t, kPacket> seeds_{};
  alignas(64) std::array<float, kPacket> light_{};
  CachedLight known_{};
};

}  // namespace lenticule::render
