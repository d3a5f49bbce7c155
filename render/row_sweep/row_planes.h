// SPDX-License-Identifier: Apache-2.0
// The planes in which the rays of pixel rows lie, and those rays.
//
// All rays of one row and height lie in the plane through the row's lens points at (y, z) =
// (lens_y_mm, 0) and the viewing line (docs/optics.md). Stripes side by side have one plane a row;
// subpixels at several heights (cells, stripes one above the other) have one for each height.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "base/interval.h"
#include "optics/row_rays.h"
#include "optics/tile_optics.h"
#include "render/row_sweep/row_buckets.h"
#include "render/row_sweep/row_sweep_kernel.h"

namespace lenticule::render {

/// Points of the plane have y = lens_y_mm + tan_y z.
struct RowPlane {
  double lens_y_mm = 0.0;
  double tan_y = 0.0;
};

/// The rays of one plane by lens, and under one lens from left to right: those from `first` on,
/// before `end`. What arrays have elsewhere means nothing.
struct PlaneRays {
  RowPlane plane;
  size_t first = 0;
  size_t end = 0;
  std::vector<float> x_mm;  ///< on the glass
  std::vector<float> tan_x;
  std::vector<int32_t> lens;      ///< ascending
  std::vector<int32_t> subpixel;  ///< of the row; empty if ray n is that of subpixel n
};

/// Makes rays for one rig. Immutable after construction, safe from any thread. Where the rig's map
/// is smooth (optics/tile_optics.h) rays come from polynomials, the same as method full's;
/// otherwise from the map itself, ten times slower.
class RowPlanes {
 public:
  /// The model must outlive it. Throws Error(Usage) for an instruction set that this machine cannot
  /// run.
  explicit RowPlanes(const optics::OpticalModel& model, Isa isa = best_isa());

  [[nodiscard]] const optics::OpticalModel& model() const { return model_; }
  [[nodiscard]] const sweep_kernel::Kernel& kernel() const { return kernel_; }
  [[nodiscard]] int rows() const { return model_.rig().panel.height_px; }
  [[nodiscard]] size_t row_subpixels() const {
    return 3 * static_cast<size_t>(model_.rig().panel.width_px);
  }
  [[nodiscard]] size_t planes_of(int row) const;

  /// 1 / Z, 0 for parallel zones.
  [[nodiscard]] double inverse_z() const { return inverse_z_; }
  /// A plane's tan_y is this less lens_y_mm / Z.
  [[nodiscard]] double eye_tan_y() const { return eye_tan_y_; }

  /// Rows whose planes can meet points that, seen from the viewing line, lie on the glass between
  /// these heights in the panel frame; a little generous.
  [[nodiscard]] RowRange rows_between(double low_mm, double high_mm) const;

  /// The plane of subpixels whose centres lie at this height on the panel, in pixels down.
  [[nodiscard]] RowPlane plane_at(double y_px) const;
  [[nodiscard]] RowPlane plane_of(int row, size_t plane) const;
  /// Of the first subpixel of the row, in pixels below the row's upper edge.
  [[nodiscard]] double height_in_row(int row) const { return layout_row(row).heights_px.front(); }

  /// Scratch of one thread.
  class Maker {
   public:
    /// `planes` must outlive it.
    explicit Maker(const RowPlanes& planes);
    /// Does not allocate once it has made a row of the kind. Rays that leave the glass beyond
    /// `within_mm` may be left out.
    void make(int row, size_t plane, PlaneRays& out, const Interval& within_mm = kEverywhere);
    /// That of one subpixel of the row that was made last, if it was left out.
    struct Ray {
      float x_mm, tan_x;
    };
    [[nodiscard]] Ray make_one(size_t subpixel) const;

   private:
    bool make_smooth(int row, PlaneRays& out, const Interval& within_mm);
    [[nodiscard]] sweep_kernel::RowPiece piece(size_t tile) const;
    /// Tiles whose rays may leave the glass there: from the first to before the second.
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
    std::vector<optics::TileOptics::Tile> tiles_;  ///< of one band of rows
    int band_ = -1;
    int in_band_ = 0;  ///< the row of the band that was made last
    bool band_smooth_ = false;
    optics::RowRays rays_;
    int evaluated_row_ = -1;
    std::vector<int32_t> order_;
  };

 private:
  /// Row of the layout: its different heights, and of each subpixel of a period which it has.
  struct LayoutRow {
    std::vector<double> heights_px;
    std::vector<uint8_t> plane;
  };
  void set_layout();
  [[nodiscard]] const LayoutRow& layout_row(int row) const;

  const optics::OpticalModel& model_;
  const sweep_kernel::Kernel& kernel_;
  optics::RowRayEvaluator evaluator_;
  std::unique_ptr<optics::TileOptics> smooth_;  ///< null where the rig is not
  size_t columns_ = 0;                          ///< of its tiles
  std::vector<LayoutRow> layout_;
  double inverse_z_;
  double eye_tan_y_;
  double low_px_ = 0.0, high_px_ = 0.0;  ///< heights inside a pixel that occur
  double top_mm_ = 0.0;                  ///< lens_y_mm at the panel's upper edge, and how it
  double rows_per_mm_ = 0.0;             ///< changes
};

}  // namespace lenticule::render
