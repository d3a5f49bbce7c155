// SPDX-License-Identifier: Apache-2.0
// KeySamples holds the samples of a frame's cache views and decides between which samples
// interpolation is allowed.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "render/integrator/light_notes.h"
#include "render/methods/adaptive/key_grid.h"
#include "render/methods/adaptive/zeroed_array.h"
#include "render/scene/surface_groups.h"

namespace lenticule::render {

/// Agreement holds the largest differences allowed between samples, in parts of a code value
/// (lookup_kernel::kCodeParts).
struct Agreement {
  int coarse = 0;   ///< between samples twice as far apart, with none between them
  int unlike = 0;   ///< if the light took another path: another shadow, another reflected object
  int alike = 0;    ///< if the light took the same path
  int bend = 0;     ///< second difference of three consecutive samples
  float apart = 0;  ///< between two views
  float secondary = 0;  ///< light from mirrored and refracted rays, relative to 1
  float around = 0;     ///< unoccluded share of the hemisphere
  float seen = 0;       ///< visible share of an area light
  float little = 0;     ///< negligible light, relative to 1

  /// Returns the light below which paths are not distinguished and rays are replaced by half of
  /// their maximum contribution. It is lower for colour-managed scenes, since dark linear light is
  /// encoded in more code values.
  [[nodiscard]] float noticed(bool colour_managed) const {
    return colour_managed ? 0.2F * little : little;
  }

  /// Returns the limits for a tolerated error in code values.
  [[nodiscard]] static Agreement for_error(double codes);
};

/// KeySamples holds one frame's samples. Thread safety: different threads may fill different rows;
/// cells are read-only afterwards.
class KeySamples {
 public:
  KeySamples() = default;
  explicit KeySamples(const KeyGrid& grid) { begin(grid); }
  /// Begins another frame. Lifetime: `grid` must outlive its use. If the grid has the same size as
  /// before, samples that are not set again keep the values of the previous frame.
  void begin(const KeyGrid& grid);
  /// Starts change detection: from now on, a sample that is set to a different value counts as
  /// changed.
  void watch_changes();

  /// Composition of a sample's light, see LightNotes.
  struct Light {
    uint32_t lit = 0, hidden = 0;
    uint32_t secondary_way = 0;
    std::array<float, 3> secondary{};
    float around = 0.0F;
    /// Visible shares of area lights, in units of 1 / kWholeAreaLight; kNotShining for
    /// LightNotes::kNoShare.
    std::array<uint8_t, LightNotes::kAreaLights> seen{};

    static constexpr int kWholeAreaLight = 240;
    static constexpr uint8_t kNotShining = 255;
    friend bool operator==(const Light&, const Light&) = default;
    [[nodiscard]] static uint8_t parts_of_area_light(float share) {
      return share < 0.0F ? kNotShining : static_cast<uint8_t>(share * kWholeAreaLight + 0.5F);
    }
  };
  struct Sample {
    std::array<uint16_t, 3> value{};  ///< code values, in parts
    uint32_t group = 0;               ///< group number of SurfaceGroups
    uint32_t way = 0;                 ///< path id of LightNotes
    Light light{};
  };
  void set(int row, int picture, int column, const Sample& sample);
  /// Sets a sample that shows no surface: its other values keep what they were and are never used.
  void set_nothing(int row, int picture, int column);

  /// Every kCoarse-th sample of every kCoarse-th row is traced first.
  static constexpr int kCoarse = 2;
  /// Returns true if a coarse sample shows the same surface as those to the right of it and below
  /// it, which must exist, and no value differs by more than `most_apart`.
  [[nodiscard]] bool shows_one_surface(int top, int picture, int left, int most_apart) const;
  /// Interpolates the three samples to the right of and below a coarse one from the coarse samples
  /// around, if these show one surface and differ little. Otherwise returns false and sets nothing.
  bool fill(int top, int picture, int left, const Agreement& agreement);
  /// Returns true if the last fill() for this place interpolated them.
  [[nodiscard]] bool is_filled(int top, int picture, int left) const {
    return filled_[index(top, picture, left)] != 0;
  }

  [[nodiscard]] const uint16_t* values() const { return values_.data(); }
  [[nodiscard]] size_t row_samples() const { return row_samples_; }

  /// Returns true if the sample shows no surface.
  [[nodiscard]] bool shows_nothing(int row, int picture, int column) const {
    return groups_[index(row, picture, column)] == SurfaceGroups::kNothing;
  }
  /// Return data of the sample at an index [row][picture][column].
  [[nodiscard]] uint32_t group(size_t at) const { return groups_[at]; }
  [[nodiscard]] const Light& light(size_t at) const { return lights_[at]; }

  /// Marks the samples of a row whose second differences, along the row and across rows, exceed the
  /// limit.
  void mark_bends(int row, const Agreement& agreement);
  /// Return true if a sample or its bend mark has changed since watch_changes(): in the cell whose
  /// upper left corner has the given index in its row, or in whole rows.
  [[nodiscard]] bool cell_changed(int row, size_t in_row) const;
  [[nodiscard]] bool rows_changed(int first, int last) const;

  /// Computes the keys and corners of the cells between rows `row` and `row` + 1 of a view, see
  /// lookup_kernel::SampleRows. `corners` is that of the first channel; those of the next channel
  /// begin row_samples() later. Where one corner shows another surface than the other three and
  /// these agree, the cell shows their surface, and the fourth corner continues it evenly.
  void find_cells(int row, int picture, const Agreement& agreement, uint32_t* keys,
                  lookup_kernel::Corners* corners) const;

 private:
  [[nodiscard]] size_t in_row(int picture, int column) const {
    return static_cast<size_t>(picture) * static_cast<size_t>(grid_->stride()) +
           static_cast<size_t>(column);
  }
  [[nodiscard]] size_t index(int row, int picture, int column) const {
    return static_cast<size_t>(row) * row_samples_ + in_row(picture, column);
  }
  [[nodiscard]] uint32_t key_of(size_t at, size_t value, const Agreement& agreement,
                                lookup_kernel::Corners* corners) const;
  /// Returns true if the four coarse samples around a place show one surface, or all nothing.
  [[nodiscard]] bool show_one_group(int top, size_t in_row, int left) const;
  [[nodiscard]] std::array<Sample, 4> corners(int top, size_t in_row, int left) const;
  [[nodiscard]] bool is_quiet(int top, size_t in_row, int left) const;

  const KeyGrid* grid_ = nullptr;
  int rows_ = 0, columns_ = 0;
  size_t row_samples_ = 0;
  ZeroedArray<uint16_t> values_;  ///< [row][channel][picture][column]
  ZeroedArray<uint32_t> groups_;  ///< [row][picture][column]
  ZeroedArray<uint32_t> ways_;
  ZeroedArray<Light> lights_;
  ZeroedArray<uint8_t> bends_;
  ZeroedArray<uint8_t> filled_;  ///< per coarse sample: the three beside it are interpolated
  ZeroedArray<uint8_t> changed_;
  bool watches_changes_ = false;
};

}  // namespace lenticule::render
