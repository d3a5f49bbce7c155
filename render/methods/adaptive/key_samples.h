// SPDX-License-Identifier: Apache-2.0
// KeyGrid defines the sample positions of method adaptive: a few cache views of the scene, each
// seen through the panel from a place on the viewing line, with samples on every few rows and every
// few pixels.
//
// All rays of a row lie in one plane with the viewing line. So a point stays in its row in every
// cache view and moves only along the row: an eye at e sees (x, z) at x_panel = (x - e z / Z) / (1
// - z / Z); if rays are parallel with tangent e, at x - e z.
//
// KeySamples holds the samples of a frame's cache views and decides between which samples
// interpolation is allowed.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <span>
#include <type_traits>

#include "base/interval.h"
#include "render/integrator/light_cache.h"
#include "render/methods/adaptive/key_lookup_kernel.h"
#include "render/rays/primary_rays.h"
#include "render/row_sweep/row_planes.h"
#include "render/scene/stage.h"
#include "render/scene/surface_groups.h"

namespace lenticule::render {

/// ZeroedArray holds elements whose bytes are zero at first. Large arrays are pages of the kernel
/// that cost nothing until an element is accessed.
template <class Element>
class ZeroedArray {
  static_assert(std::is_trivially_copyable_v<Element>);

 public:
  ZeroedArray() = default;
  /// Throws std::bad_alloc.
  explicit ZeroedArray(size_t size)
      : elements_(static_cast<Element*>(std::calloc(std::max<size_t>(size, 1), sizeof(Element)))),
        size_(size) {
    if (!elements_) throw std::bad_alloc();
  }

  [[nodiscard]] size_t size() const { return size_; }
  [[nodiscard]] Element* data() { return elements_.get(); }
  [[nodiscard]] const Element* data() const { return elements_.get(); }
  [[nodiscard]] Element* begin() { return data(); }
  [[nodiscard]] const Element* begin() const { return data(); }
  [[nodiscard]] Element* end() { return data() + size_; }
  [[nodiscard]] const Element* end() const { return data() + size_; }
  [[nodiscard]] Element& operator[](size_t n) { return elements_.get()[n]; }
  [[nodiscard]] const Element& operator[](size_t n) const { return elements_.get()[n]; }

 private:
  struct Free {
    void operator()(Element* elements) const { std::free(elements); }
  };
  std::unique_ptr<Element, Free> elements_;
  size_t size_ = 0;
};

/// Spacing of the samples. The samples of odd views lie half a step above and to the left of those
/// of even views.
struct KeySpacing {
  int row_step = 4;      ///< panel rows from one row of samples to the next
  double columns = 4.0;  ///< pixels from one column of samples to the next
  int cache_views = 2;   ///< number of cache views, at least 2
};

/// Ranges of a rig's rays on the panel and on the viewing line.
struct RayReach {
  Interval panel_mm;
  Interval eyes;  ///< mm; tangents for parallel rays
};
[[nodiscard]] RayReach reach_of(const RowPlanes& planes);

/// Chooses the number of cache views by the width of the viewing zone: one per 0.22 radians (a
/// dozen degrees), over which view-dependent shading changes little, and other shading not at all.
/// For `shiny` scenes one per 0.18 radians (ten degrees), since reflected and refracted content
/// moves between views, and a thin object may be visible in neither.
[[nodiscard]] KeySpacing spacing_for(const RowPlanes& planes, const RayReach& reach, bool shiny);

/// KeyGrid is immutable, except for assignment.
class KeyGrid {
 public:
  /// Lifetime: `planes` must outlive the object. The views contain everything that the rig's rays
  /// see, except content far from the panel at its left and right ends.
  KeyGrid(const RowPlanes& planes, const Stage& stage, const RayReach& reach,
          const KeySpacing& spacing);

  [[nodiscard]] int cache_views() const { return lookup_.cache_views; }
  [[nodiscard]] int columns() const { return lookup_.columns; }
  /// Returns the range of places on the viewing line to which the rig's rays go, with a generous
  /// margin.
  [[nodiscard]] Interval eyes() const { return eyes_; }
  /// Returns the number of elements from one view's row to the next; slightly more than columns().
  [[nodiscard]] int stride() const { return lookup_.stride; }
  [[nodiscard]] int rows() const { return rows_; }
  /// Between holds the two rows of samples around a panel row, for even and for odd views.
  struct Between {
    int above[2];
    float part[2];  ///< weight of the next row
  };
  [[nodiscard]] Between between(int panel_row) const;
  /// Returns the number of elements of one row of samples in all views.
  [[nodiscard]] size_t row_samples() const {
    return static_cast<size_t>(cache_views()) * static_cast<size_t>(stride());
  }
  [[nodiscard]] const lookup_kernel::Grid& lookup() const { return lookup_; }

  [[nodiscard]] PanelRay ray(int row, int cache_view, int column) const;
  /// Returns the panel row that contains the sample or is nearest to it.
  [[nodiscard]] int panel_row(int row, int cache_view) const;
  /// Returns true if the samples of another grid of the same rig lie in the same places.
  [[nodiscard]] bool is_same(const KeyGrid& other) const;

 private:
  const RowPlanes* planes_;
  lookup_kernel::Grid lookup_{};
  int rows_ = 0;
  int row_step_ = 0;
  double height_px_ = 0.0;  ///< height of subpixels in their row
  double x_first_ = 0.0, x_step_ = 0.0;
  double eye_first_ = 0.0, eye_step_ = 0.0;
  Interval eyes_{};
};

/// Tolerances holds the largest differences allowed between samples, in parts of a code value
/// (lookup_kernel::kCodeParts).
struct Tolerances {
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
  [[nodiscard]] static Tolerances for_error(double codes);
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

  /// Composition of a sample's light, see LightRecord.
  struct Light {
    uint32_t lit = 0, hidden = 0;
    uint32_t secondary_way = 0;
    std::array<float, 3> secondary{};
    float around = 0.0F;
    /// Visible shares of area lights, in units of 1 / kWholeAreaLight; kNotShining for
    /// LightRecord::kNoShare.
    std::array<uint8_t, LightRecord::kAreaLights> seen{};

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
    uint32_t way = 0;                 ///< path id of LightRecord
    Light light{};
  };
  void set(int row, int cache_view, int column, const Sample& sample);
  /// Sets a sample that shows no surface: its other values keep what they were and are never used.
  void set_nothing(int row, int cache_view, int column);

  /// Every kCoarse-th sample of every kCoarse-th row is traced first.
  static constexpr int kCoarse = 2;
  /// Returns true if a coarse sample shows the same surface as those to the right of it and below
  /// it, which must exist, and no value differs by more than `most_apart`.
  [[nodiscard]] bool shows_one_surface(int top, int cache_view, int left, int most_apart) const;
  /// Interpolates the three samples to the right of and below a coarse one from the coarse samples
  /// around, if these show one surface and differ little. Otherwise returns false and sets nothing.
  bool fill(int top, int cache_view, int left, const Tolerances& tolerances);
  /// Returns true if the last fill() for this place interpolated them.
  [[nodiscard]] bool is_filled(int top, int cache_view, int left) const {
    return filled_[index(top, cache_view, left)] != 0;
  }

  [[nodiscard]] const uint16_t* values() const { return values_.data(); }
  [[nodiscard]] size_t row_samples() const { return row_samples_; }

  /// Returns true if the sample shows no surface.
  [[nodiscard]] bool shows_nothing(int row, int cache_view, int column) const {
    return groups_[index(row, cache_view, column)] == SurfaceGroups::kNothing;
  }
  /// Return data of the sample at an index [row][cache_view][column].
  [[nodiscard]] uint32_t group(size_t at) const { return groups_[at]; }
  [[nodiscard]] const Light& light(size_t at) const { return lights_[at]; }

  /// Marks the samples of a row whose second differences, along the row and across rows, exceed the
  /// limit.
  void mark_bends(int row, const Tolerances& tolerances);
  /// Return true if a sample or its bend mark has changed since watch_changes(): in the cell whose
  /// upper left corner has the given index in its row, or in whole rows.
  [[nodiscard]] bool cell_changed(int row, size_t in_row) const;
  [[nodiscard]] bool rows_changed(int first, int last) const;

  /// Computes the keys and corners of the cells between rows `row` and `row` + 1 of a view, see
  /// lookup_kernel::SampleRows. `corners` is that of the first channel; those of the next channel
  /// begin row_samples() later. Where one corner shows another surface than the other three and
  /// these agree, the cell shows their surface, and the fourth corner continues it evenly.
  void find_cells(int row, int cache_view, const Tolerances& tolerances, uint32_t* keys,
                  lookup_kernel::Corners* corners) const;

 private:
  [[nodiscard]] size_t in_row(int cache_view, int column) const {
    return static_cast<size_t>(cache_view) * static_cast<size_t>(grid_->stride()) +
           static_cast<size_t>(column);
  }
  [[nodiscard]] size_t index(int row, int cache_view, int column) const {
    return static_cast<size_t>(row) * row_samples_ + in_row(cache_view, column);
  }
  [[nodiscard]] uint32_t key_of(size_t at, size_t value, const Tolerances& tolerances,
                                lookup_kernel::Corners* corners) const;
  /// Returns true if the four coarse samples around a place show one surface, or all nothing.
  [[nodiscard]] bool show_one_group(int top, size_t in_row, int left) const;
  [[nodiscard]] std::array<Sample, 4> corners(int top, size_t in_row, int left) const;
  [[nodiscard]] bool is_quiet(int top, size_t in_row, int left) const;

  const KeyGrid* grid_ = nullptr;
  int rows_ = 0, columns_ = 0;
  size_t row_samples_ = 0;
  ZeroedArray<uint16_t> values_;  ///< [row][channel][cache_view][column]
  ZeroedArray<uint32_t> groups_;  ///< [row][cache_view][column]
  ZeroedArray<uint32_t> ways_;
  ZeroedArray<Light> lights_;
  ZeroedArray<uint8_t> bends_;
  ZeroedArray<uint8_t> filled_;  ///< per coarse sample: the three beside it are interpolated
  ZeroedArray<uint8_t> changed_;
  bool watches_changes_ = false;
};

}  // namespace lenticule::render
