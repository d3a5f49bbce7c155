// SPDX-License-Identifier: Apache-2.0
// RowPlanes computes the planes of the pixel rows' rays, and these rays.
//
// All rays of one row and height lie in the plane through the row's lens points at (y, z) =
// (lens_y_mm, 0) and the viewing line (docs/panel/optics.md). Layouts with vertical stripes have
// one plane per row; layouts with subpixels at several heights (cells, horizontal stripes) have one
// plane per height.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

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
  RowBuckets(int rows, std::span<const RowRange> ranges);

  /// Calls number(n) for each number n whose range contains `row`, in an order that depends on the
  /// ranges only.
  template <class Visit>
  void visit(int row, const Visit& number) const {
    for (size_t node = rows_ + static_cast<size_t>(row); node > 0; node >>= 1)
      for (size_t n = begin_[node]; n < begin_[node + 1]; ++n) number(numbers_[n]);
  }

 private:
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
  RowPlane plane;
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
  explicit RowPlanes(const optics::OpticalModel& model, Isa isa = best_isa());

  [[nodiscard]] const optics::OpticalModel& model() const { return model_; }
  [[nodiscard]] const sweep_kernel::Kernel& kernel() const { return kernel_; }
  [[nodiscard]] int rows() const { return model_.rig().panel.height_px; }
  [[nodiscard]] size_t row_subpixels() const {
    return 3 * static_cast<size_t>(model_.rig().panel.width_px);
  }
  [[nodiscard]] size_t planes_of(int row) const;

  /// Returns 1 / Z, or 0 for parallel zones.
  [[nodiscard]] double inverse_z() const { return inverse_z_; }
  /// Returns eye_tan_y; a plane's tan_y is eye_tan_y - lens_y_mm / Z.
  [[nodiscard]] double eye_tan_y() const { return eye_tan_y_; }

  /// Returns the rows whose planes can contain points that project from the viewing line to these
  /// heights on the panel, in the panel frame; with a small margin.
  [[nodiscard]] RowRange rows_between(double low_mm, double high_mm) const;

  /// Returns the plane of subpixels whose centres lie at this height on the panel, in pixels from
  /// the top.
  [[nodiscard]] RowPlane plane_at(double y_px) const;
  [[nodiscard]] RowPlane plane_of(int row, size_t plane) const;
  /// Returns the height of the row's first subpixel, in pixels below the row's upper edge.
  [[nodiscard]] double height_in_row(int row) const { return layout_row(row).heights_px.front(); }

  /// Maker makes rays. Thread safety: used by one thread.
  class Maker {
   public:
    /// Lifetime: `planes` must outlive the object.
    explicit Maker(const RowPlanes& planes);
    /// Makes the rays of a plane. Does not allocate after the first row of its kind. Rays that
    /// leave the panel outside `within_mm` may be left out.
    void make(int row, size_t plane, PlaneRays& out, const Interval& within_mm = kEverywhere);
    /// Ray of one subpixel.
    struct Ray {
      float x_mm, tan_x;
    };
    [[nodiscard]] Ray make_one(size_t subpixel) const;

   private:
    bool make_smooth(int row, PlaneRays& out, const Interval& within_mm);
    [[nodiscard]] sweep_kernel::RowPiece piece(size_t tile) const;
    /// Tiles [begin, end) whose rays may leave the panel in a range.
    struct Tiles {
      size_t begin, end;
    };
    [[nodiscard]] Tiles tiles_within(const Interval& within_mm) const;
    void make_tile(size_t tile, PlaneRays& out) const;
    bool expand(int band);
    void resolve(const sweep_kernel::RowPiece& piece, size_t tile, int count, float* x, float* tan,
                 int32_t* lens) const;
    void make_exact(int row, size_t plane, PlaneRays& out);

    const RowPlanes& planes_;
    std::vector<TileOptics::Tile> tiles_;  ///< tiles of one band of rows
    int band_ = -1;
    int in_band_ = 0;  ///< last row made, counted in the band
    bool band_smooth_ = false;
    optics::RowRays rays_;
    int evaluated_row_ = -1;
    std::vector<int32_t> order_;
  };

 private:
  /// LayoutRow is a row of the layout: its distinct heights, and the height index of each subpixel
  /// of a period.
  struct LayoutRow {
    std::vector<double> heights_px;
    std::vector<uint8_t> plane;
  };
  void set_layout();
  [[nodiscard]] const LayoutRow& layout_row(int row) const;

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
