// SPDX-License-Identifier: Apache-2.0
// LightResolver decides, from the nearest samples, which light contributions of a subpixel need no
// rays of their own.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "render/methods/adaptive/key_samples.h"

namespace lenticule::render {

/// ResolvedAreaLights holds the known visible shares of a subpixel's area lights.
struct ResolvedAreaLights {
  std::array<uint16_t, LightNotes::kAreaLights> seen{};  ///< unit 1 / kWholeAreaLight
  std::array<uint16_t, LightNotes::kAreaLights>
      apart{};  ///< spread of the samples, in the same unit

  static constexpr int kWholeAreaLight = 256 * KeySamples::Light::kWholeAreaLight;
};

/// ResolvedLight is small, since millions are sorted; so area lights are stored separately.
struct ResolvedLight {
  uint32_t lit = 0, hidden = 0;  ///< bits of LightNotes on which all samples agree
  float secondary = 0.0F;        ///< valid if secondary_known
  float around = 0.0F;           ///< valid if around_known
  uint32_t area_lights = 0;      ///< index of its ResolvedAreaLights, if any area light is known
  bool secondary_known = false;
  bool around_known = false;
  uint8_t area_lights_known = 0;  ///< a bit for each area light whose share is known

  /// Purpose of the sample rays needed: the first unknown area light, or one of the constants
  /// below.
  uint8_t wanted = kNoSamples;

  static constexpr uint8_t kAllSamples = LightNotes::kAreaLights;  ///< ambient, or too little known
  static constexpr uint8_t kNoSamples = LightNotes::kAreaLights + 1;
  static_assert(LightNotes::kAreaLights <= 8, "a bit for each lamp");
};

/// LightResolver resolves light for subpixels of one frame. Thread safety: used by one thread. The
/// result for the four samples around a cell is computed once for all subpixels that look up this
/// cell.
class LightResolver {
 public:
  /// Lifetime: `samples` and `grid` must outlive the object and must not change. `soft` selects the
  /// sampled light.
  LightResolver(const KeySamples& samples, const KeyGrid& grid, const Agreement& agreement,
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
    std::array<uint8_t, LightNotes::kAreaLights> count{}, least, most{};

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
  Agreement agreement_;
  bool colour_managed_, finds_around_, finds_area_lights_;
  std::vector<Corners> remembered_;                 ///< indexed by place in a row of samples
  std::vector<AreaLights> remembered_area_lights_;  ///< the same for area lights, if resolved
};

}  // namespace lenticule::render
