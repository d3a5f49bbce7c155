// SPDX-License-Identifier: Apache-2.0
// RowPlanes computes the planes of the pixel rows' rays, and these rays.
//
// All rays of one row and height lie in the plane through the row's lens points at (y, z) =
// (lens_y_mm, 0) and the viewing line (docs/panel/optics.md). Layouts with vertical stripes have
// one plane per row; layouts with subpixels at several heights (cells, horizontal stripes) have one
// plane per height.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/interval.h"
#include "optics/row_rays.h"
#include "render/rays/tile_optics.h"
#include "render/row_sweep/row_sweep_kernel.h"

namespace lenticule::render {

/// Rows [first, last]; empty if last < first.
struct RowRange {
  int first = 0;
  int last = -1;
};

/// RowBuckets is a segment tree over the rows. Each number is stored in the few nodes that cover
/// its range, so that a row's numbers are those on the path from its leaf to the root, and even a
/// million ranges over all rows take a few nodes each. Thread safety: immutable, usable from any
/// thread.
class RowBuckets {
 public:
  /// Stores number n with ranges[n], clipped to [0, rows).
  RowBuckets(int rows, std::span<const RowRange> ranges)
      : rows_(static_cast<size_t>(std::max(rows, 1))), begin_(2 * rows_ + 1) {
    LENTICULE_CHECK(ranges.size() <= UINT32_MAX);
    for (const RowRange& range : ranges)
      cover(rows_, range, [&](size_t node) { ++begin_[node + 1]; });
    for (size_t node = 1; node < begin_.size(); ++node) begin_[node] += begin_[node - 1];
    numbers_.resize(begin_.back());
    std::vector<size_t> next(begin_.begin(), begin_.end() - 1);
    for (size_t n = 0; n < ranges.size(); ++n)
      cover(rows_, ranges[n],
            [&](size_t node) { numbers_[next[node]++] = static_cast<uint32_t>(n); });
  }

  /// Calls number(n) for each number n whose range contains `row`, in an order that depends on the
  /// ranges only.
  template <class Visit>
  void visit(int row, const Visit& number) const {
    for (size_t node = rows_ + static_cast<size_t>(row); node > 0; node >>= 1)
      for (size_t n = begin_[node]; n < begin_[node + 1]; ++n) number(numbers_[n]);
  }

 private:
  /// Calls visit(node) for the nodes that cover a range. Leaf j is node rows + j; the children of
  /// node n are 2 n and 2 n + 1.
  template <class Visit>
  static void cover(size_t rows, RowRange range, const Visit& visit) {
    const int first = std::max(range.first, 0);
    const int last = std::min(range.last, static_cast<int>(rows) - 1);
    if (last < first) return;
    size_t low = rows + static_cast<size_t>(first);
    size_t high = rows + static_cast<size_t>(last) + 1;
    for (; low < high; low >>= 1, high >>= 1) {
      if (low & 1) visit(low++);
      if (high & 1) visit(--high);
    }
  }
  size_t rows_;
  std::vector<size_t> begin_;  ///< first element in numbers_, per node
  std::vector<uint32_t> numbers_;
};

/// Plane of the points with y = lens_y_mm + tan_y z.
struct RowPlane {
  double lens_y_mm = 0.0;
  double tan_y = 0.0;
};

/// PlaneRays holds the rays of one plane, ordered by lens and from left to right under each lens.
/// Valid elements are [first, end).
struct PlaneRays {
  size_t first = 0;
  size_t end = 0;
  std::vector<float> x_mm;  ///< position on the panel
  std::vector<float> tan_x;
  std::vector<int32_t> lens;      ///< ascending
  std::vector<int32_t> subpixel;  ///< index in the row; empty if ray n belongs to subpixel n
};

/// RowPlanes makes rays for one rig. If the rig's map is smooth (render/rays/tile_optics.h), the
/// rays come from polynomials and equal those of method full; otherwise from the map itself, which
/// is ten times slower. Thread safety: immutable after construction, usable from any thread.
class RowPlanes {
 public:
  /// Throws Error(Usage) for an instruction set that this machine does not support. Lifetime: the
  /// model must outlive the object.
  explicit RowPlanes(const optics::OpticalModel& model, Isa isa = best_isa())
      : model_(model), kernel_(LENTICULE_SELECT_KERNEL(isa, kSweepKernel)), evaluator_(model, isa) {
    const optics::Eye& eye = model.design_eye();
    const bool parallel = std::isinf(eye.z_mm);
    inverse_z_ = parallel ? 0.0 : 1.0 / eye.z_mm;
    eye_tan_y_ = parallel ? eye.y : eye.y / eye.z_mm;
    smooth_ = TileOptics::make_first(model_, kWidths, kUpright);
    columns_ = smooth_ ? static_cast<size_t>(smooth_->constants().columns) : 0;
    set_layout();
    top_mm_ = plane_at(0.0).lens_y_mm;
    rows_per_mm_ = 1.0 / (top_mm_ - plane_at(1.0).lens_y_mm);
  }

  [[nodiscard]] const optics::OpticalModel& model() const { return model_; }
  [[nodiscard]] const sweep_kernel::Kernel& kernel() const { return kernel_; }
  [[nodiscard]] int rows() const { return model_.rig().panel.height_px; }
  [[nodiscard]] size_t row_subpixels() const {
    return 3 * static_cast<size_t>(model_.rig().panel.width_px);
  }
  [[nodiscard]] size_t planes_of(int row) const { return layout_row(row).heights_px.size(); }

  /// Returns 1 / Z, or 0 for parallel zones.
  [[nodiscard]] double inverse_z() const { return inverse_z_; }
  /// Returns eye_tan_y; a plane's tan_y is eye_tan_y - lens_y_mm / Z.
  [[nodiscard]] double eye_tan_y() const { return eye_tan_y_; }

  /// Returns the rows whose planes can contain points that project from the viewing line to these
  /// heights on the panel, in the panel frame; with a small margin.
  [[nodiscard]] RowRange rows_between(double low_mm, double high_mm) const {
    constexpr double kGenerous = 1e-3;
    const double far = rows() + 8.0;
    const auto row_at = [&](double mm) {
      return std::clamp((top_mm_ - mm) * rows_per_mm_, -far, far);
    };
    return {static_cast<int>(std::ceil(row_at(high_mm) - high_px_ - kGenerous)),
            static_cast<int>(std::floor(row_at(low_mm) - low_px_ + kGenerous))};
  }

  /// Returns the plane of subpixels whose centres lie at this height on the panel, in pixels from
  /// the top.
  [[nodiscard]] RowPlane plane_at(double y_px) const {
    const double gap = model_.rig().sheet.gap.value;
    const double panel_y_mm = model_.rig().panel.y_mm(y_px);
    const double tan_y = (eye_tan_y_ - panel_y_mm * inverse_z_) / (1.0 + gap * inverse_z_);
    return {.lens_y_mm = panel_y_mm + gap * tan_y, .tan_y = tan_y};
  }
  [[nodiscard]] RowPlane plane_of(int row, size_t plane) const {
    return plane_at(row + layout_row(row).heights_px[plane]);
  }
  /// Returns the height of the row's first subpixel, in pixels below the row's upper edge.
  [[nodiscard]] double height_in_row(int row) const { return layout_row(row).heights_px.front(); }

  /// Maker makes rays. Thread safety: used by one thread.
  class Maker {
   public:
    /// Lifetime: `planes` must outlive the object.
    explicit Maker(const RowPlanes& planes) : planes_(planes) {}
    /// Makes the rays of a plane. Does not allocate after the first row of its kind. Rays that
    /// leave the panel outside `within_mm` may be left out.
    void make(int row, size_t plane, PlaneRays& out, const Interval& within_mm = kEverywhere) {
      LENTICULE_CHECK(row >= 0 && row < planes_.rows() && plane < planes_.planes_of(row));
      if (!planes_.smooth_ || !make_smooth(row, out, within_mm)) make_exact(row, plane, out);
    }
    /// Ray of one subpixel.
    struct Ray {
      float x_mm, tan_x;
    };
    [[nodiscard]] Ray make_one(size_t subpixel) const {
      const size_t tile = subpixel / planes_.columns_;
      const auto column = static_cast<int>(subpixel % planes_.columns_);
      const double off = planes_.smooth_->exact_off(tiles_[tile], column, in_band_);
      Ray ray;
      planes_.kernel_.make_ray(piece(tile), column, static_cast<float>(off), &ray.x_mm, &ray.tan_x);
      return ray;
    }

   private:
    bool make_smooth(int row, PlaneRays& out, const Interval& within_mm) {
      if (!expand(row / TileOptics::kRows)) return false;
      in_band_ = row % TileOptics::kRows;
      const Tiles tiles = tiles_within(within_mm);
      out.first = tiles.begin * planes_.columns_;
      out.end = std::min(tiles.end * planes_.columns_, planes_.row_subpixels());
      out.subpixel.clear();
      out.x_mm.resize(std::max(out.x_mm.size(), tiles_.size() * planes_.columns_));
      out.tan_x.resize(out.x_mm.size());
      out.lens.resize(out.x_mm.size());
      for (size_t t = tiles.begin; t < tiles.end; ++t) make_tile(t, out);
      if (out.first == 0) return true;
      // Begins at a whole lens, since the places of a partial lens differ from those of all others.
      while (out.first + 1 < out.end && out.lens[out.first] == out.lens[out.first + 1]) ++out.first;
      if (out.first + 1 < out.end) ++out.first;
      return true;
    }
    /// Returns a row of a tile.
    [[nodiscard]] sweep_kernel::RowPiece piece(size_t number) const {
      const TileOptics::Constants& rig = planes_.smooth_->constants();
      const TileOptics::Tile& tile = tiles_[number];
      const auto r = static_cast<size_t>(in_band_);
      sweep_kernel::RowPiece piece{};
      for (size_t colour = 0; colour < 3; ++colour) {
        for (size_t n = 0; n < 3; ++n) {
          piece.phase[colour][n] = tile.phase[colour][n][r];
          piece.bend[colour][n] = tile.bend[colour][n][r];
        }
        piece.x0[colour] = static_cast<float>(tile.x0_mm[colour][r]);
      }
      piece.colours_alike = rig.colours_alike;
      piece.coefficients = rig.coefficients;
      for (size_t n = 0; n < static_cast<size_t>(piece.coefficients); ++n)
        piece.tangent[n] = tile.tangent[n][r];
      for (size_t n = 0; n < TileOptics::kShiftCoefficients; ++n)
        piece.shift[n] = tile.shift_mm[n][r];
      piece.lens_step = static_cast<float>(rig.lens_step);
      piece.x_step = static_cast<float>(rig.x_step_mm);
      piece.safe = static_cast<float>(0.5 - rig.phase_error);
      return piece;
    }
    /// Tiles [begin, end) whose rays may leave the panel in a range.
    struct Tiles {
      size_t begin, end;
    };
    /// Returns the tiles that can have rays in a range. Lens points step back along a row by at
    /// most one lens, and a tile's rays may begin in the middle of a lens.
    [[nodiscard]] Tiles tiles_within(const Interval& within_mm) const {
      Tiles tiles{0, tiles_.size()};
      const double room = 3.0 * planes_.model_.pitch_mm();
      const auto starts_at = [&](size_t tile) {
        const Ray first = make_one(tile * planes_.columns_);
        return double{first.x_mm};
      };
      while (tiles.begin + 1 < tiles.end && starts_at(tiles.begin + 1) < within_mm.low - room)
        ++tiles.begin;
      while (tiles.end > tiles.begin + 1 && starts_at(tiles.end - 1) > within_mm.high + room)
        --tiles.end;
      return tiles;
    }
    void make_tile(size_t tile, PlaneRays& out) const {
      const sweep_kernel::RowPiece row = piece(tile);
      const size_t at = tile * planes_.columns_;
      const auto count = static_cast<int>(std::min(planes_.columns_, planes_.row_subpixels() - at));
      float* x = out.x_mm.data() + at;
      float* tan = out.tan_x.data() + at;
      int32_t* lens = out.lens.data() + at;
      const int whole = (count + sweep_kernel::kLanes - 1) / sweep_kernel::kLanes;
      if (planes_.kernel_.make_rays(row, whole * sweep_kernel::kLanes, x, tan, lens)) [[unlikely]]
        resolve(row, tile, count, x, tan, lens);
    }
    /// Computes the tiles of a band of rows, from left to right.
    bool expand(int band) {
      if (band == band_) return band_smooth_;
      band_ = band;
      const size_t columns = planes_.columns_;
      const size_t count = (planes_.row_subpixels() + columns - 1) / columns;
      tiles_.resize(count);
      band_smooth_ = true;
      for (size_t t = 0; t < count && band_smooth_; ++t)
        band_smooth_ = planes_.smooth_->expand(band * TileOptics::kRows,
                                               static_cast<int>(t * columns), tiles_[t]);
      return band_smooth_;
    }
    /// Recomputes with the exact map the rays whose lens the polynomials leave uncertain.
    void resolve(const sweep_kernel::RowPiece& piece, size_t tile, int count, float* x, float* tan,
                 int32_t* lens) const {
      for (int c = 0; c < count; ++c) {
        if (!planes_.kernel_.uncertain(piece, c)) continue;
        const double off = planes_.smooth_->exact_off(tiles_[tile], c, in_band_);
        const double* phase = piece.phase[c % 3];
        lens[c] = static_cast<int32_t>(std::lround(phase[0] + c * (phase[1] + c * phase[2]) - off));
        planes_.kernel_.make_ray(piece, c, static_cast<float>(off), x + c, tan + c);
      }
    }
    void make_exact(int row, size_t plane, PlaneRays& out) {
      if (row != evaluated_row_)
        planes_.evaluator_.evaluate(row, 0, planes_.model_.rig().panel.width_px, rays_);
      evaluated_row_ = row;
      const LayoutRow& layout = planes_.layout_row(row);
      out.subpixel.clear();
      for (size_t s = 0, in_period = 0; s < planes_.row_subpixels(); ++s) {
        if (layout.plane[in_period] == plane) out.subpixel.push_back(static_cast<int32_t>(s));
        in_period = in_period + 1 < layout.plane.size() ? in_period + 1 : 0;
      }
      const auto place = [&](int32_t s) {
        return std::pair(rays_.lens[static_cast<size_t>(s)], s);
      };
      if (!std::ranges::is_sorted(out.subpixel, {}, place))
        std::ranges::sort(out.subpixel, {}, place);
      out.first = 0;
      out.end = out.subpixel.size();
      out.x_mm.resize(out.end);
      out.tan_x.resize(out.end);
      out.lens.resize(out.end);
      for (size_t n = 0; n < out.end; ++n) {
        const auto s = static_cast<size_t>(out.subpixel[n]);
        out.x_mm[n] = static_cast<float>(rays_.lens_x_mm[s]);
        out.tan_x[n] = static_cast<float>(rays_.tan_x[s]);
        out.lens[n] = rays_.lens[s];
      }
    }

    const RowPlanes& planes_;
    std::vector<TileOptics::Tile> tiles_;  ///< tiles of one band of rows
    int band_ = -1;
    int in_band_ = 0;  ///< last row made, counted in the band
    bool band_smooth_ = false;
    optics::RowRays rays_;
    int evaluated_row_ = -1;
  };

 private:
  static constexpr std::array<int, TileOptics::kRows> kUpright{};
  static constexpr std::array kWidths{384, 192, 96};
  static_assert(kWidths.back() % (3 * sweep_kernel::kLanes) == 0);

  static_assert(sweep_kernel::kMostCoefficients == TileOptics::kMostCoefficients &&
                sweep_kernel::kShiftCoefficients == TileOptics::kShiftCoefficients);

  /// LayoutRow is a row of the layout: its distinct heights, and the height index of each subpixel
  /// of a period.
  struct LayoutRow {
    std::vector<double> heights_px;
    std::vector<uint8_t> plane;
  };
  void set_layout() {
    const optics::SubpixelLayout& layout = model_.rig().panel.layout;
    low_px_ = high_px_ = layout.offset(0, 0, 0).y_px;
    layout_.resize(static_cast<size_t>(layout.rows()));
    for (int j = 0; j < layout.rows(); ++j) {
      LayoutRow& row = layout_[static_cast<size_t>(j)];
      for (int s = 0; s < 3 * layout.columns(); ++s) {
        const double y_px = layout.offset(s / 3, j, s % 3).y_px;
        low_px_ = std::min(low_px_, y_px);
        high_px_ = std::max(high_px_, y_px);
        const auto at = std::find(row.heights_px.begin(), row.heights_px.end(), y_px);
        // A byte is enough: a layout has at most 64 columns of three.
        row.plane.push_back(static_cast<uint8_t>(at - row.heights_px.begin()));
        if (at == row.heights_px.end()) row.heights_px.push_back(y_px);
      }
    }
  }
  [[nodiscard]] const LayoutRow& layout_row(int row) const {
    return layout_[static_cast<size_t>(row) % layout_.size()];
  }

  const optics::OpticalModel& model_;
  const sweep_kernel::Kernel& kernel_;
  optics::RowRayEvaluator evaluator_;
  std::unique_ptr<TileOptics> smooth_;  ///< null if the map is not smooth
  size_t columns_ = 0;                  ///< columns of its tiles
  std::vector<LayoutRow> layout_;
  double inverse_z_;
  double eye_tan_y_;
  double low_px_ = 0.0, high_px_ = 0.0;  ///< range of subpixel heights inside a pixel
  double top_mm_ = 0.0;                  ///< lens_y_mm at the panel's upper edge
  double rows_per_mm_ = 0.0;             ///< rows per millimetre of lens_y_mm
};

}  // namespace lenticule::render
