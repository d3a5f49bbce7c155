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
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>

#include "base/error.h"
#include "base/interval.h"
#include "render/integrator/light_cache.h"
#include "render/methods/adaptive/key_lookup_kernel.h"
#include "render/rays/primary_rays.h"
#include "render/row_sweep/row_planes.h"
#include "render/scene/stage.h"
#include "render/scene/surface_groups.h"

namespace lenticule::render {

struct Free {
  void operator()(void* memory) const { std::free(memory); }
};
template <class Element>
using ZeroedArray = std::unique_ptr<Element[], Free>;

/// Makes elements whose bytes are zero at first. Large arrays are pages of the kernel that cost
/// nothing until an element is accessed. Throws std::bad_alloc.
template <class Element>
void make_zeroed(size_t size, ZeroedArray<Element>& out) {
  static_assert(std::is_trivially_copyable_v<Element>);
  out.reset(static_cast<Element*>(std::calloc(size, sizeof(Element))));
  if (!out) throw std::bad_alloc();
}

/// Ranges of a rig's rays on the panel and on the viewing line.
struct RayReach {
  Interval panel_mm;
  Interval eyes;  ///< mm; tangents for parallel rays
};
/// Evaluates three rows, since the others lie between them.
[[nodiscard]] inline RayReach reach_of(const RowPlanes& planes) {
  const double distance = planes.inverse_z() > 0.0 ? 1.0 / planes.inverse_z() : 0.0;
  RowPlanes::Maker maker(planes);
  PlaneRays rays;
  RayReach reach;
  for (const int row : {0, planes.rows() / 2, planes.rows() - 1}) {
    maker.make(row, 0, rays);
    for (size_t n = 0; n < rays.end; ++n) {
      const double x = rays.x_mm[n], tan = rays.tan_x[n];
      if (!std::isfinite(x) || !std::isfinite(tan)) continue;
      reach.panel_mm.extend(x);
      reach.eyes.extend(distance > 0.0 ? x + tan * distance : tan);
    }
  }
  return reach;
}

/// Returns the number of cache views, at least two, for the width of the viewing zone: one per 0.22
/// radians (a dozen degrees), over which view-dependent shading changes little, and other shading
/// not at all. For `shiny` scenes one per 0.18 radians (ten degrees), since reflected and refracted
/// content moves between views, and a thin object may be visible in neither.
[[nodiscard]] inline int cache_views_for(const RowPlanes& planes, const RayReach& reach,
                                         bool shiny) {
  const double furthest_apart = shiny ? 0.18 : 0.22;  // radians
  constexpr double kMostViews = 16.0;
  const double wide = reach.eyes.width() * (planes.inverse_z() > 0.0 ? planes.inverse_z() : 1.0);
  const double apart = std::clamp(std::ceil(wide / furthest_apart - 0.1), 1.0, kMostViews - 1.0);
  return 1 + static_cast<int>(apart);
}

/// KeyGrid is immutable, except for assignment. The samples of odd views lie half a step above and
/// to the left of those of even views.
class KeyGrid {
 public:
  /// Lifetime: `planes` must outlive the object. The views contain everything that the rig's rays
  /// see, except content far from the panel at its left and right ends.
  KeyGrid(const RowPlanes& planes, const Stage& stage, const RayReach& reach, int cache_views)
      : planes_(&planes) {
    LENTICULE_CHECK(cache_views >= 2);
    const optics::Panel& panel = planes.model().rig().panel;
    eye_first_ = reach.eyes.low;
    eyes_ = reach.eyes.widened(0.5 * reach.eyes.width());
    eye_step_ = std::max(reach.eyes.width() / (cache_views - 1), 1e-6);
    x_step_ = kColumns * panel.pixel_width.value;
    // Rounded up to whole steps, so that sample positions stay the same when the nearest object
    // moves slightly.
    const double aside = x_step_ * std::ceil(std::min(furthest_move(planes, stage, eye_step_),
                                                      reach.panel_mm.width() / 4) /
                                             x_step_);
    x_first_ = reach.panel_mm.low - aside - x_step_;
    const int columns =
        static_cast<int>(std::ceil((reach.panel_mm.width() + 2.0 * aside) / x_step_)) + 3;
    constexpr int kPadding = 16;
    rows_ = (planes.rows() - 1 + kRowStep / 2) / kRowStep + 2;
    height_px_ = planes.height_in_row(0);
    const double inverse_z = planes.inverse_z();
    constexpr double kNear = 0.027;  // radians, a degree and a half
    const double angle = eye_step_ * (inverse_z > 0.0 ? inverse_z : 1.0);
    lookup_ = {.x_first = static_cast<float>(x_first_),
               .columns_per_mm = static_cast<float>(1.0 / x_step_),
               .eye_first = static_cast<float>(eye_first_),
               .eye_step = static_cast<float>(eye_step_),
               .cache_views_per_eye = static_cast<float>(1.0 / eye_step_),
               .near = static_cast<float>(std::min(kNear / angle, 0.5)),
               .inverse_z = static_cast<float>(inverse_z),
               .distance = inverse_z > 0.0 ? static_cast<float>(1.0 / inverse_z) : 0.0F,
               .cache_views = cache_views,
               .columns = columns,
               .stride = (columns + kPadding) / kPadding * kPadding};
  }

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
  [[nodiscard]] Between between(int panel_row) const {
    Between between{};
    for (const int odd : {0, 1}) {
      const int from_first = panel_row + odd * (kRowStep / 2);
      between.above[odd] = from_first / kRowStep;
      between.part[odd] = static_cast<float>(from_first % kRowStep) / static_cast<float>(kRowStep);
    }
    return between;
  }

  /// Returns the number of elements of one row of samples in all views.
  [[nodiscard]] size_t row_samples() const {
    return static_cast<size_t>(cache_views()) * static_cast<size_t>(stride());
  }

  [[nodiscard]] const lookup_kernel::Grid& lookup() const { return lookup_; }

  [[nodiscard]] PanelRay ray(int row, int cache_view, int column) const {
    const int odd = cache_view % 2;
    const RowPlane plane = planes_->plane_at(row * kRowStep - odd * (kRowStep / 2) + height_px_);
    const double x = x_first_ + (column - 0.5 * odd) * x_step_;
    const double eye = eye_first_ + cache_view * eye_step_;
    const double inverse_z = planes_->inverse_z();
    const double tan = inverse_z > 0.0 ? (eye - x) * inverse_z : eye;
    return {.x_mm = x, .y_mm = plane.lens_y_mm, .tan_x = tan, .tan_y = plane.tan_y};
  }

  /// Returns the panel row that contains the sample or is nearest to it.
  [[nodiscard]] int panel_row(int row, int cache_view) const {
    return std::clamp(row * kRowStep - cache_view % 2 * (kRowStep / 2), 0, planes_->rows() - 1);
  }

  /// Returns true if the samples of another grid of the same rig lie in the same places.
  [[nodiscard]] bool is_same(const KeyGrid& other) const {
    return rows_ == other.rows_ && columns() == other.columns() &&
           cache_views() == other.cache_views() && x_first_ == other.x_first_ &&
           x_step_ == other.x_step_ && eye_first_ == other.eye_first_ &&
           eye_step_ == other.eye_step_;
  }

 private:
  /// Returns the largest distance that a point moves on the panel between neighbouring views.
  static double furthest_move(const RowPlanes& planes, const Stage& stage, double eye_step) {
    double most = 0.0;
    for (const double z : {stage.near_mm, stage.far_mm}) {
      const double wider =
          planes.inverse_z() > 0.0 ? z * planes.inverse_z() / (1.0 - z * planes.inverse_z()) : z;
      if (std::isfinite(wider)) most = std::max(most, std::abs(wider) * eye_step);
    }
    return most;
  }

  static constexpr int kRowStep = 4;       ///< panel rows from one row of samples to the next
  static constexpr double kColumns = 5.0;  ///< pixels from one column of samples to the next

  const RowPlanes* planes_;
  lookup_kernel::Grid lookup_{};
  int rows_ = 0;
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

  static int parts(double codes) {
    return static_cast<int>(codes * lookup_kernel::kCodeParts + 0.5);
  }

  /// Returns the limits for a tolerated error in code values.
  [[nodiscard]] static Tolerances for_error(double codes) {
    // Linear interpolation between samples with a second difference of b has an error of b / 8 in
    // the middle. Differences between corners or views are interpolated, so at most half of them is
    // error.
    return {.coarse = parts(4.0 * codes),
            .unlike = parts(2.0 * codes),
            .alike = parts(24.0),
            .bend = parts(8.0 * codes),
            .apart = static_cast<float>(parts(8.0 * codes)),
            .secondary = static_cast<float>(8.0 * codes / 255.0),
            .around = 0.25F,
            .seen = 0.75F,
            .little = static_cast<float>(0.5 * codes / 255.0)};
  }
};

/// KeySamples holds one frame's samples. Thread safety: different threads may fill different rows;
/// cells are read-only afterwards.
class KeySamples {
 public:
  /// Begins another frame. Lifetime: `grid` must outlive its use. If the grid has the same size as
  /// before, samples that are not set again keep the values of the previous frame.
  void begin(const KeyGrid& grid) {
    grid_ = &grid;
    watches_changes_ = false;
    if (rows_ == grid.rows() && columns_ == grid.columns() && row_samples_ == grid.row_samples())
      return;
    rows_ = grid.rows();
    columns_ = grid.columns();
    row_samples_ = grid.row_samples();
    const size_t count = row_samples_ * static_cast<size_t>(rows_);
    // The padding of the rows stays zero.
    make_zeroed(3 * count, values_);
    for (auto* numbers : {&groups_, &ways_}) make_zeroed(count, *numbers);
    make_zeroed(count, lights_);
    for (auto* flags : {&bends_, &filled_, &changed_}) make_zeroed(count, *flags);
  }

  /// Starts change detection: from now on, a sample that is set to a different value counts as
  /// changed.
  void watch_changes() {
    std::fill_n(changed_.get(), row_samples_ * static_cast<size_t>(rows_), uint8_t{0});
    watches_changes_ = true;
  }

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
  void set(int row, int cache_view, int column, const Sample& sample) {
    if (sample.group == SurfaceGroups::kNothing) return set_nothing(row, cache_view, column);
    const size_t at = index(row, cache_view, column);
    std::array<uint16_t, 3> before{};
    for (size_t c = 0; c < 3; ++c) {
      uint16_t& value =
          values_[(3 * static_cast<size_t>(row) + c) * row_samples_ + in_row(cache_view, column)];
      before[c] = std::exchange(value, sample.value[c]);
    }
    if (watches_changes_ && (before != sample.value || groups_[at] != sample.group ||
                             ways_[at] != sample.way || lights_[at] != sample.light))
      changed_[at] = 1;
    groups_[at] = sample.group;
    ways_[at] = sample.way;
    lights_[at] = sample.light;
  }

  /// Sets a sample that shows no surface: its other values keep what they were and are never used.
  void set_nothing(int row, int cache_view, int column) {
    const size_t at = index(row, cache_view, column);
    if (watches_changes_ && groups_[at] != SurfaceGroups::kNothing) changed_[at] = 1;
    groups_[at] = SurfaceGroups::kNothing;
  }

  /// Every kCoarse-th sample of every kCoarse-th row is traced first.
  static constexpr int kCoarse = 2;
  /// Returns true if a coarse sample shows the same surface as those to the right of it and below
  /// it, which must exist, and no value differs by more than `most_apart`.
  [[nodiscard]] bool shows_one_surface(int top, int cache_view, int left, int most_apart) const {
    const size_t first = in_row(cache_view, 0);
    return show_one_group(top, first, left) &&
           largest_range(corners(top, first, left)) <= most_apart;
  }

  /// Interpolates the three samples to the right of and below a coarse one from the coarse samples
  /// around, if these show one surface and differ little. Otherwise returns false and sets nothing.
  bool fill(int top, int cache_view, int left, const Tolerances& tolerances) {
    if (top + kCoarse >= rows_ || left + kCoarse >= columns_) return false;
    const size_t first = in_row(cache_view, 0);
    uint8_t& filled = filled_[index(top, cache_view, left)];
    filled = 0;
    if (!show_one_group(top, first, left)) return false;
    if (shows_nothing(top, cache_view, left)) {
      filled = 1;
      set_nothing(top, cache_view, left + 1);
      set_nothing(top + 1, cache_view, left);
      set_nothing(top + 1, cache_view, left + 1);
      return true;
    }
    const std::array<Sample, 4> corner = corners(top, first, left);
    if (!show_one_way(corner, tolerances.coarse) || !is_quiet(top, first, left)) return false;
    filled = 1;
    const Sample above = middle(corner[0], corner[1]), below = middle(corner[2], corner[3]);
    set(top, cache_view, left + 1, above);
    set(top + 1, cache_view, left, middle(corner[0], corner[2]));
    set(top + 1, cache_view, left + 1, middle(above, below));
    return true;
  }

  /// Returns true if the last fill() for this place interpolated them.
  [[nodiscard]] bool is_filled(int top, int cache_view, int left) const {
    return filled_[index(top, cache_view, left)] != 0;
  }

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
  void mark_bends(int row, const Tolerances& tolerances) {
    const size_t first = static_cast<size_t>(row) * row_samples_;
    const size_t above = row > 0 ? first - row_samples_ : first;
    const size_t below = row + 1 < rows_ ? first + row_samples_ : first;
    const auto alike = [&](size_t a, size_t b) {
      return groups_[a] == groups_[b] && ways_[a] == ways_[b];
    };
    const auto bend = [&](size_t a, size_t b, size_t c) {  // indices of values
      return std::abs(int{values_[a]} - 2 * int{values_[b]} + int{values_[c]});
    };
    const bool has_column = above != first && below != first;
    for (size_t n = 1; n + 1 < row_samples_; ++n) {
      const size_t at = first + n;
      const bool in_row = alike(at - 1, at) && alike(at, at + 1);
      const bool in_column = has_column && alike(above + n, at) && alike(at, below + n);
      int most = 0;
      for (size_t c = 0; c < 3; ++c) {
        const size_t value = (3 * static_cast<size_t>(row) + c) * row_samples_ + n;
        if (in_row) most = std::max(most, bend(value - 1, value, value + 1));
        if (in_column)
          most = std::max(most, bend(value - 3 * row_samples_, value, value + 3 * row_samples_));
      }
      const uint8_t bends = most > tolerances.bend ? 1 : 0;
      if (std::exchange(bends_[at], bends) != bends) changed_[at] = 1;
    }
  }

  /// Return true if a sample or its bend mark has changed since watch_changes(): in the cell whose
  /// upper left corner has the given index in its row, or in whole rows.
  [[nodiscard]] bool cell_changed(int row, size_t in_row) const {
    const uint8_t* above = changed_.get() + static_cast<size_t>(row) * row_samples_ + in_row;
    const uint8_t* below = above + row_samples_;
    return (above[0] | above[1] | below[0] | below[1]) != 0;
  }

  [[nodiscard]] bool rows_changed(int first, int last) const {
    return std::any_of(changed_.get() + static_cast<size_t>(first) * row_samples_,
                       changed_.get() + static_cast<size_t>(last + 1) * row_samples_,
                       [](uint8_t changed) { return changed != 0; });
  }

  /// Computes the keys and corners of the cells between rows `row` and `row` + 1 of a view, see
  /// lookup_kernel::SampleRows. `corners` is that of the first channel; those of the next channel
  /// begin row_samples() later. Where one corner shows another surface than the other three and
  /// these agree, the cell shows their surface, and the fourth corner continues it evenly.
  void find_cells(int row, int cache_view, const Tolerances& tolerances, uint32_t* keys,
                  lookup_kernel::Corners* corners) const {
    const size_t first = index(row, cache_view, 0);
    const auto last = static_cast<size_t>(grid_->stride()) - 1;
    keys[last] = 0;
    const size_t value = 3 * static_cast<size_t>(row) * row_samples_ + in_row(cache_view, 0);
    for (size_t n = 0; n < last; ++n)
      keys[n] = key_of(first + n, value + n, tolerances, corners + n);
  }

 private:
  /// Returns the largest difference between the corners' values of one channel.
  static int range(const std::array<uint16_t, 4>& values) {
    const auto [low, high] = std::ranges::minmax(values);
    return high - low;
  }

  /// Returns the largest difference between corners in any channel.
  static int largest_range(std::span<const Sample, 4> corners) {
    int most = 0;
    for (size_t c = 0; c < 3; ++c)
      most = std::max(most, range({corners[0].value[c], corners[1].value[c], corners[2].value[c],
                                   corners[3].value[c]}));
    return most;
  }

  /// Returns true if the light of corners that show one surface took one path and differs little.
  static bool show_one_way(std::span<const Sample, 4> corners, int most_apart) {
    const Sample& first = corners[0];
    for (const Sample& corner : corners)
      if (corner.way != first.way || corner.light.lit != first.light.lit ||
          corner.light.hidden != first.light.hidden)
        return false;
    return largest_range(corners) <= most_apart;
  }

  /// Returns the mean of two samples that show one surface.
  static Sample middle(const Sample& a, const Sample& b) {
    Sample between = a;
    for (size_t c = 0; c < 3; ++c) {
      between.value[c] = static_cast<uint16_t>((a.value[c] + b.value[c] + 1) / 2);
      between.light.secondary[c] = 0.5F * (a.light.secondary[c] + b.light.secondary[c]);
    }
    between.light.around = 0.5F * (a.light.around + b.light.around);
    for (size_t n = 0; n < between.light.seen.size(); ++n)
      between.light.seen[n] = static_cast<uint8_t>((a.light.seen[n] + b.light.seen[n] + 1) / 2);
    return between;
  }

  static constexpr size_t kNoCorner = 4;
  /// Returns the corner that shows another surface than the other three, or kNoCorner if all show
  /// one. Returns nothing if fewer than three show one.
  static std::optional<size_t> odd_corner(const std::array<uint32_t, 4>& groups) {
    for (size_t odd = 0; odd < 4; ++odd) {
      const uint32_t beside = groups[odd ^ 1];
      if (beside != groups[odd ^ 2] || beside != groups[odd ^ 3]) continue;
      return beside == groups[odd] ? kNoCorner : odd;
    }
    return std::nullopt;
  }

  /// Returns the value that a corner has if it continues the other three evenly.
  static uint16_t continued(const std::array<uint16_t, 4>& codes, size_t corner) {
    const int beside = codes[corner ^ 1], across = codes[corner ^ 2], opposite = codes[corner ^ 3];
    return static_cast<uint16_t>(
        std::clamp(beside + across - opposite, 0, 255 * lookup_kernel::kCodeParts));
  }

  [[nodiscard]] size_t in_row(int cache_view, int column) const {
    return static_cast<size_t>(cache_view) * static_cast<size_t>(grid_->stride()) +
           static_cast<size_t>(column);
  }

  [[nodiscard]] size_t index(int row, int cache_view, int column) const {
    return static_cast<size_t>(row) * row_samples_ + in_row(cache_view, column);
  }

  /// Returns the key of a cell and, if it shows a surface, sets its corners in the three channels.
  /// `at` is the index of its first corner, `value` that of the corner's first value.
  [[nodiscard]] uint32_t key_of(size_t at, size_t value, const Tolerances& tolerances,
                                lookup_kernel::Corners* corners) const {
    const std::array<size_t, 4> corner = {at, at + 1, at + row_samples_, at + row_samples_ + 1};
    const std::optional<size_t> odd = odd_corner(
        {groups_[corner[0]], groups_[corner[1]], groups_[corner[2]], groups_[corner[3]]});
    if (!odd) return 0;
    const size_t first = *odd == 0 ? 1 : 0;
    const uint32_t group = groups_[corner[first]];
    if (group == SurfaceGroups::kNothing) return 0;
    bool same_way = true, bends = false;
    for (size_t n = 0; n < corner.size(); ++n) {
      if (n == *odd) continue;
      same_way = same_way && ways_[corner[n]] == ways_[corner[first]];
      bends = bends || bends_[corner[n]] != 0;
    }
    const bool even = same_way && !bends;
    if (*odd != kNoCorner && !even) return 0;
    int most = 0;
    for (size_t c = 0; c < 3; ++c) {
      const uint16_t* above = values_.get() + value + c * row_samples_;
      const uint16_t* below = above + 3 * row_samples_;
      std::array<uint16_t, 4> codes = {above[0], above[1], below[0], below[1]};
      if (*odd != kNoCorner) codes[*odd] = continued(codes, *odd);
      corners[c * row_samples_] = {{codes[0], codes[1]}, {codes[2], codes[3]}};
      most = std::max(most, range(codes));
    }
    if (most <= (even ? tolerances.alike : tolerances.unlike)) return group;
    return *odd == kNoCorner ? group | lookup_kernel::kUneven : 0;
  }

  /// Returns true if the four coarse samples around a place show one surface, or all nothing.
  [[nodiscard]] bool show_one_group(int top, size_t in_row, int left) const {
    const uint32_t* above = groups_.get() + static_cast<size_t>(top) * row_samples_ + in_row +
                            static_cast<size_t>(left);
    const uint32_t* below = above + kCoarse * row_samples_;
    return above[kCoarse] == above[0] && below[0] == above[0] && below[kCoarse] == above[0];
  }

  [[nodiscard]] std::array<Sample, 4> corners(int top, size_t in_row, int left) const {
    std::array<Sample, 4> corners;
    for (size_t n = 0; n < 4; ++n) {
      const size_t row = static_cast<size_t>(top) + (n >= 2 ? kCoarse : 0);
      const size_t column = in_row + static_cast<size_t>(left) + (n % 2 != 0 ? kCoarse : 0);
      const size_t at = row * row_samples_ + column;
      corners[n] = {.group = groups_[at], .way = ways_[at], .light = lights_[at]};
      for (size_t c = 0; c < 3; ++c)
        corners[n].value[c] = values_[(3 * row + c) * row_samples_ + column];
    }
    return corners;
  }

  /// Returns true if the coarse samples around a cell of one view have the same path as the cell's
  /// first sample, which must show a surface, wherever they show it: thin shadows and reflections
  /// between samples show up in samples nearby.
  [[nodiscard]] bool is_quiet(int top, size_t in_row, int left) const {
    constexpr int kAround = 3 * kCoarse;
    const auto place = [&](int r, int c) {
      return static_cast<size_t>(r) * row_samples_ + in_row + static_cast<size_t>(c);
    };
    const size_t first = place(top, left);
    const int end_row = std::min(top + kCoarse + kAround, rows_ - 1);
    const int end_column = std::min(left + kCoarse + kAround, columns_ - 1);
    for (int r = std::max(top - kAround, 0); r <= end_row; r += kCoarse)
      for (int c = std::max(left - kAround, 0); c <= end_column; c += kCoarse)
        if (groups_[place(r, c)] == groups_[first] && ways_[place(r, c)] != ways_[first])
          return false;
    return true;
  }

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
