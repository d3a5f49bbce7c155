// SPDX-License-Identifier: Apache-2.0
// Shading of the subpixels that the cache views do not settle. ColourTracer takes the samples: it
// traces sixteen rays in all three colours and records the paths of their light. LightResolver
// compares the records of the samples around a subpixel: light on which they agree need not be
// traced again. UncertainShader shades the subpixels of a band in packets with what is left.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <numeric>
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
             Colours& out) {
    const auto light = [&](int c) { return std::span<float, kPacket>(out.light[c], kPacket); };
    std::array<int32_t, kPacket> channel;
    channel.fill(kFirst);
    tracer_.trace_recording(scene, plan_, channel, groups, noticed, packet, light(kFirst));
    out.notes = tracer_.notes();
    std::copy_n(out.notes.secondary, kPacket, out.secondary[kFirst]);
    CachedLight known{};  // the lights that reach the surfaces are the same in all colours
    known.set_lights(out.notes.lit, out.notes.hidden);
    for (const int c : kOthers) {
      if (scene.pbr != nullptr) {  // traced in all channels at once
        std::ranges::copy(tracer_.pbr_light(packet, c), out.light[c]);
        std::copy_n(out.secondary[kFirst], kPacket, out.secondary[c]);
        continue;
      }
      channel.fill(c);
      tracer_.trace_known(scene, plan_, channel, known, packet, light(c), true);
      std::copy_n(tracer_.notes().secondary, kPacket, out.secondary[c]);
    }
    for (size_t r = 0; r < kPacket; ++r) {
      const uint32_t geometry = packet.rays.hit.geomID[r];
      const bool met = packet.valid[r] != 0 && geometry != RTC_INVALID_GEOMETRY_ID;
      out.group[r] = met ? groups.of(geometry, packet.rays.hit.primID[r]) : SurfaceGroups::kNothing;
    }
  }

  [[nodiscard]] RecordingTracer& tracer() { return tracer_; }

 private:
  /// The path of the light is recorded for green, which dominates perceived brightness.
  static constexpr int kFirst = 1;
  static constexpr int kOthers[] = {0, 2};

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
                bool colour_managed, const SoftLight& soft)
      : samples_(samples),
        grid_(grid),
        tolerances_(tolerances),
        colour_managed_(colour_managed),
        finds_around_(soft.samples_ambient()),
        finds_area_lights_(soft.shadow_samples > 0),
        cached_(grid.row_samples()),
        cached_area_lights_(finds_area_lights_ ? grid.row_samples() : 0) {}

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
               std::vector<ResolvedAreaLights>& area_lights) {
    Corners corners{.group = point.group};
    float weight_of_views = 0.0F;  // total weight of the views that show the surface
    for (const Place& place : point.places) {
      if (place.cell < 0) continue;
      const Corners& of_cell = corners_of(point, place);
      if (of_cell.count > 0) weight_of_views += place.weight;
      corners.add(of_cell);
    }
    constexpr int kFewCorners = 3;
    out = {};
    if (finds_around_ || finds_area_lights_) out.wanted = ResolvedLight::kAllSamples;
    if (corners.count < kFewCorners) return;
    out.lit = corners.lit;
    out.hidden = corners.hidden;
    const float most = corners.same_way ? tolerances_.secondary : 0.5F * tolerances_.secondary;
    const auto channel = static_cast<size_t>(point.channel);
    const float low = corners.low[channel], high = corners.high[channel];
    // Reflections differ between viewing places.
    const bool from_near = weight_of_views >= 1.0F - grid_.lookup().near;
    out.secondary_known = from_near && difference(low, high, colour_managed_) <= most;
    out.around_known = finds_around_ && corners.least_around >= 0.0F &&
                       corners.most_around - corners.least_around <= tolerances_.around;
    if (out.around_known || !finds_around_) out.wanted = ResolvedLight::kNoSamples;
    if (finds_area_lights_) {
      const ResolvedAreaLights resolved = resolve_area_lights(point, out);
      out.area_lights = static_cast<uint32_t>(area_lights.size());
      if (out.area_lights_known != 0) area_lights.push_back(resolved);
    }
    const bool dark = low == 0.0F && high == 0.0F;
    if (out.around_known || (out.secondary_known && !dark)) blend(point, out);
  }

  /// Returns true if no sample around the point changed (KeySamples::cell_changed).
  [[nodiscard]] bool is_as_before(const KeyGrid::Between& rows,
                                  const std::array<Place, 2>& places) const {
    return std::ranges::none_of(places, [&](const Place& place) {
      return place.cell >= 0 &&
             samples_.cell_changed(rows.above[place.odd], static_cast<size_t>(place.cell));
    });
  }

 private:
  static constexpr int kFinerParts =
      ResolvedAreaLights::kWholeAreaLight / KeySamples::Light::kWholeAreaLight;
  static constexpr float kLittle = 1e-3F;  // a minimum, so that no corner has weight zero

  /// Returns the difference on a perceptual scale: encoding is approximately the square root of
  /// linear light.
  static float difference(float low, float high, bool colour_managed) {
    return colour_managed ? std::sqrt(std::max(high, 0.0F)) - std::sqrt(std::max(low, 0.0F))
                          : high - low;
  }

  /// Number of corners on which an area light would shine, and the range of its visible shares
  /// there.
  struct AreaLights {
    std::array<uint8_t, LightRecord::kAreaLights> count{}, least, most{};

    AreaLights() { least.fill(KeySamples::Light::kNotShining); }
    void add(const KeySamples::Light& light) {
      for (size_t n = 0; n < least.size(); ++n) {
        if (light.seen[n] == KeySamples::Light::kNotShining) continue;
        ++count[n];
        least[n] = std::min(least[n], light.seen[n]);
        most[n] = std::max(most[n], light.seen[n]);
      }
    }
    void add(const AreaLights& other) {
      for (size_t n = 0; n < least.size(); ++n) {
        count[n] = static_cast<uint8_t>(count[n] + other.count[n]);
        least[n] = std::min(least[n], other.least[n]);
        most[n] = std::max(most[n], other.most[n]);
      }
    }
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

    void add(const KeySamples::Light& light) {
      add(Corners{.count = 1,
                  .way = light.secondary_way,
                  .lit = light.lit,
                  .hidden = light.hidden,
                  .low = light.secondary,
                  .high = light.secondary,
                  .least_around = light.around,
                  .most_around = light.around});
    }
    /// Merges the corners of another cell with the same surface.
    void add(const Corners& other) {
      if (other.count == 0) return;
      if (count == 0) way = other.way;
      same_way = same_way && other.same_way && way == other.way;
      count += other.count;
      lit &= other.lit;
      hidden &= other.hidden;
      for (size_t c = 0; c < 3; ++c) {
        low[c] = std::min(low[c], other.low[c]);
        high[c] = std::max(high[c], other.high[c]);
      }
      least_around = std::min(least_around, other.least_around);
      most_around = std::max(most_around, other.most_around);
    }
  };
  const Corners& corners_of(const Point& point, const Place& place) {
    Corners& corners = cached_[static_cast<size_t>(place.cell)];
    const int row = point.rows.above[place.odd];
    if (corners.row == row && corners.group == point.group) return corners;
    corners = {.group = point.group, .row = row};
    AreaLights area_lights;
    each_corner(point, place, [&](size_t at, float) {
      corners.add(samples_.light(at));
      if (finds_area_lights_) area_lights.add(samples_.light(at));
    });
    if (finds_area_lights_) cached_area_lights_[static_cast<size_t>(place.cell)] = area_lights;
    return corners;
  }

  /// Calls `use(index, weight)` for each corner of a cell.
  template <class Use>
  void each_corner(const Point& point, const Place& place, const Use& use) const {
    const float of_row_below = point.rows.part[place.odd];
    const size_t above = static_cast<size_t>(point.rows.above[place.odd]) * samples_.row_samples() +
                         static_cast<size_t>(place.cell);
    for (int corner = 0; corner < 4; ++corner) {
      const bool below = corner >= 2, next = corner % 2 != 0;
      const size_t at = above + (below ? samples_.row_samples() : 0) + (next ? 1 : 0);
      if (samples_.group(at) != point.group) continue;
      use(at,
          (below ? of_row_below : 1.0F - of_row_below) * (next ? place.part : 1.0F - place.part));
    }
  }

  /// Resolves area lights for cells that corners_of() has computed. An area light that shines on
  /// only a few corners contributes little and is left unresolved.
  [[nodiscard]] ResolvedAreaLights resolve_area_lights(const Point& point,
                                                       ResolvedLight& out) const {
    constexpr int kFew = 2;
    const auto most = static_cast<int>(tolerances_.seen * KeySamples::Light::kWholeAreaLight);
    AreaLights area_lights;
    for (const Place& place : point.places)
      if (place.cell >= 0) area_lights.add(cached_area_lights_[static_cast<size_t>(place.cell)]);
    ResolvedAreaLights resolved;
    for (size_t n = 0; n < area_lights.count.size(); ++n) {
      const int apart = area_lights.most[n] - area_lights.least[n];
      const bool known = area_lights.count[n] >= kFew && apart <= most;
      if (known) out.area_lights_known = static_cast<uint8_t>(out.area_lights_known | 1U << n);
      if (known) resolved.apart[n] = static_cast<uint16_t>(apart * kFinerParts);
      const bool wanted = !known && area_lights.count[n] > 0;
      if (wanted && out.wanted == ResolvedLight::kNoSamples) out.wanted = static_cast<uint8_t>(n);
    }
    if (out.area_lights_known != 0) blend_area_lights(point, resolved);
    return resolved;
  }

  /// Computes the means of the corners, even those that are not used.
  void blend(const Point& point, ResolvedLight& out) const {
    const auto channel = static_cast<size_t>(point.channel);
    float secondary = 0.0F, around = 0.0F, weights = 0.0F;
    for (const Place& place : point.places) {
      if (place.cell < 0) continue;
      each_corner(point, place, [&](size_t at, float in_cell) {
        const float weight = place.weight * in_cell + kLittle;
        secondary += weight * samples_.light(at).secondary[channel];
        around += weight * samples_.light(at).around;
        weights += weight;
      });
    }
    out.secondary = secondary / weights;
    out.around = around / weights;
  }

  /// Computes the means of the area lights' shares over the corners on which they shine.
  void blend_area_lights(const Point& point, ResolvedAreaLights& out) const {
    std::array<float, LightRecord::kAreaLights> seen{}, weights{};
    for (const Place& place : point.places) {
      if (place.cell < 0) continue;
      each_corner(point, place, [&](size_t at, float in_cell) {
        const float weight = place.weight * in_cell + kLittle;
        const KeySamples::Light& light = samples_.light(at);
        for (size_t n = 0; n < seen.size(); ++n) {
          const bool shines = light.seen[n] != KeySamples::Light::kNotShining;
          seen[n] += shines ? weight * static_cast<float>(light.seen[n]) : 0.0F;
          weights[n] += shines ? weight : 0.0F;
        }
      });
    }
    for (size_t n = 0; n < seen.size(); ++n)
      if (weights[n] > 0.0F)
        out.seen[n] = static_cast<uint16_t>(seen[n] / weights[n] * kFinerParts + 0.5F);
  }

  const KeySamples& samples_;
  const KeyGrid& grid_;
  Tolerances tolerances_;
  bool colour_managed_, finds_around_, finds_area_lights_;
  std::vector<Corners> cached_;                 ///< indexed by place in a row of samples
  std::vector<AreaLights> cached_area_lights_;  ///< the same for area lights, if resolved
};

/// UncertainSubpixel is a subpixel that must be shaded individually, on the surface that it sees.
struct UncertainSubpixel {
  int32_t at = 0;    ///< 3 i + channel
  uint16_t row = 0;  ///< index in the band
  float x_mm = 0.0F, tan_x = 0.0F, z_mm = 0.0F;
  uint32_t geometry = 0, primitive = 0, group = 0;
  ResolvedLight resolved{};
};

/// UncertainBand collects the uncertain subpixels of a band of rows and orders them for shading.
/// Thread safety: threads may work on different rows. It keeps its memory from band to band.
class UncertainBand {
 public:
  struct Row {
    RowPlane plane;
    std::vector<UncertainSubpixel> subpixels;     ///< ascending
    std::vector<ResolvedAreaLights> area_lights;  ///< see ResolvedLight::area_lights
  };

  /// Begins a band without subpixels.
  void clear(const TilePlan& plan) {
    ordered_.clear();
    for (Row& row : rows_) {
      row.area_lights.clear();
      row.subpixels.clear();
      // Takes address space only, until a row needs it.
      row.subpixels.reserve(static_cast<size_t>(plan.row_subpixels()));
    }
  }

  [[nodiscard]] Row& row(size_t row) { return rows_[row]; }
  [[nodiscard]] const Row& row(size_t row) const { return rows_[row]; }
  [[nodiscard]] std::span<const UncertainSubpixel* const> ordered() const { return ordered_; }

  /// Orders subpixels by kind, then by group of sheared columns, then downwards, so that
  /// neighbouring rays are close together.
  void order(const TilePlan& plan) {
    const int lean = plan.shift(TilePlan::kRows - 1);  // positive or negative
    const int first = std::min(lean, 0);
    const size_t across =
        static_cast<size_t>(plan.row_subpixels() + std::abs(lean)) / kTogether + 1;
    const auto column = [&](const UncertainSubpixel& s) {
      return static_cast<size_t>(s.at + plan.shift(s.row) - first) / kTogether +
             kind_of(s) * across;
    };
    std::vector<uint32_t> first_of_column(kKinds * across + 1);
    for (const Row& row : rows_)
      for (const UncertainSubpixel& s : row.subpixels) ++first_of_column[column(s) + 1];
    std::partial_sum(first_of_column.begin(), first_of_column.end(), first_of_column.begin());
    ordered_.resize(first_of_column.back());
    for (const Row& row : rows_)
      for (const UncertainSubpixel& s : row.subpixels) ordered_[first_of_column[column(s)]++] = &s;
  }

 private:
  /// Number of sheared columns whose subpixels are traced together, row by row.
  static constexpr size_t kTogether = 16;
  /// Kinds of subpixels. Packets hold one kind if possible: a lane with secondary rays costs almost
  /// as much as sixteen, and transparent surfaces are traced lane by lane.
  static constexpr size_t kWays = 3;
  static constexpr size_t kKinds = kWays * (ResolvedLight::kNoSamples + 1);
  static size_t kind_of(const UncertainSubpixel& s) {
    const size_t sampled = kWays * s.resolved.wanted;
    if (s.resolved.secondary_known) return sampled;
    return sampled + (SurfaceGroups::lets_light_through(s.group) ? 2 : 1);
  }

  std::array<Row, TilePlan::kRows> rows_;
  std::vector<const UncertainSubpixel*> ordered_;
};

/// UncertainShader shades uncertain subpixels in packets of neighbours. It belongs to one thread.
class UncertainShader {
 public:
  /// Lifetime: `plan` must outlive the object.
  explicit UncertainShader(const TilePlan& plan) : plan_(plan) { init_packets({&packet_, 1}); }

  /// Shades a part of the ordered subpixels of a band on their known surfaces, traces the light
  /// that is not resolved, and calls `write(subpixel, light)`. Rows are counted from `first_row`.
  /// The calling thread must flush denormals.
  template <class Write>
  void shade(const Scene& scene, double start_mm, int first_row, const UncertainBand& band,
             std::span<const UncertainSubpixel* const> part, RecordingTracer& tracer,
             const Write& write) {
    for (size_t first = 0; first < part.size(); first += kPacket) {
      const auto lanes = part.subspan(first, std::min(kPacket, part.size() - first));
      load(scene, start_mm, first_row, band, lanes);
      if (tracer.needs_seeds()) tracer.set_seeds(seeds_);
      tracer.trace_known(scene, plan_, channel_, known_, packet_, light_);
      for (size_t r = 0; r < lanes.size(); ++r) write(*lanes[r], light_[r]);
    }
  }

 private:
  static const WideTriangle* wide_triangle_of(const Scene& scene, const UncertainSubpixel& s) {
    if (scene.wide_triangles.empty()) return nullptr;
    const GeometryEntry& entry = scene.geometries[s.geometry];
    if (entry.kind != GeometryEntry::Kind::Mesh) return nullptr;
    return scene.wide_triangle(scene.meshes[entry.mesh], s.primitive);
  }

  /// Computes the hit distance in double precision, since single precision is too coarse for cuts
  /// as long as those of wide triangles.
  static void set_distance(const WideTriangle& triangle, RayPacket& packet, size_t r) {
    RTCRay16& ray = packet.rays.ray;
    const Vec3 origin{double{ray.org_x[r]}, double{ray.org_y[r]}, double{ray.org_z[r]}};
    const Vec3 way{double{ray.dir_x[r]}, double{ray.dir_y[r]}, double{ray.dir_z[r]}};
    const Roots roots = meet(triangle, origin, way);
    if (roots.count > 0 && roots.t[0] > 0.0) ray.tfar[r] = static_cast<float>(roots.t[0]);
  }

  void load(const Scene& scene, double start_mm, int first_row, const UncertainBand& band,
            std::span<const UncertainSubpixel* const> lanes) {
    std::array<uint32_t, kPacket> lit, hidden;
    known_.secondary_lanes = known_.around.lanes = 0;
    for (KnownShare& seen : known_.seen) seen.lanes = 0;
    for (size_t r = 0; r < kPacket; ++r) {
      // Idle lanes repeat the last ray.
      const UncertainSubpixel& s = *lanes[std::min(r, lanes.size() - 1)];
      const UncertainBand::Row& row = band.row(s.row);
      packet_.valid[r] = r < lanes.size() ? -1 : 0;
      channel_[r] = s.at % 3;
      seeds_[r] = sampling::subpixel_seed(first_row + s.row, s.at, 0);  // as in method full
      set_panel_ray(scene, start_mm,
                    {.x_mm = double{s.x_mm},
                     .y_mm = row.plane.lens_y_mm,
                     .tan_x = double{s.tan_x},
                     .tan_y = row.plane.tan_y},
                    packet_, r);
      packet_.rays.ray.tfar[r] = static_cast<float>(start_mm) - s.z_mm;  // millimetres of z
      packet_.rays.hit.geomID[r] = s.geometry;
      packet_.rays.hit.primID[r] = s.primitive;
      if (const WideTriangle* wide = wide_triangle_of(scene, s)) set_distance(*wide, packet_, r);
      lit[r] = s.resolved.lit;
      hidden[r] = s.resolved.hidden;
      if (s.resolved.secondary_known) known_.secondary_lanes |= 1U << r;
      known_.secondary[r] = s.resolved.secondary;
      if (s.resolved.around_known) known_.around.lanes |= 1U << r;
      known_.around.share[r] = s.resolved.around;
      for (uint32_t left = s.resolved.area_lights_known; left != 0; left &= left - 1) {
        const auto area_light = static_cast<size_t>(std::countr_zero(left));
        known_.seen[area_light].lanes |= 1U << r;
        constexpr float kPart = 1.0F / ResolvedAreaLights::kWholeAreaLight;
        const ResolvedAreaLights& area_lights = row.area_lights[s.resolved.area_lights];
        known_.seen[area_light].share[r] = kPart * static_cast<float>(area_lights.seen[area_light]);
        known_.seen[area_light].apart[r] =
            kPart * static_cast<float>(area_lights.apart[area_light]);
      }
    }
    known_.set_lights(lit, hidden);
  }

  const TilePlan& plan_;
  RayPacket packet_{};
  alignas(64) std::array<int32_t, kPacket> channel_{};
  std::array<uint32_t, kPacket> seeds_{};
  alignas(64) std::array<float, kPacket> light_{};
  CachedLight known_{};
};

}  // namespace lenticule::render
