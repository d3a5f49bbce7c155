// SPDX-License-Identifier: Apache-2.0
// The points of the frame before, and where they are on the next.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "optics/model.h"
#include "render/methods/reuse/lens_numbers.h"
#include "render/methods/reuse/reprojection_kernel.h"
#include "render/options/reuse_options.h"
#include "render/rays/tile.h"
#include "render/scene/stage.h"

namespace lenticule::render {

/// Holds 24 bytes for each subpixel of the panel. A frame goes through it in three rounds over all
/// tiles, each round from any number of threads and finished before the next: project() every tile,
/// take() every tile, keep() every tile, after begin().
class PointHistory {
 public:
  /// Both must outlive it.
  PointHistory(const optics::OpticalModel& model, const TilePlan& plan);

  /// How the scene moves on the panel from the frame before to the next.
  void begin(const Affine& next_from_last);
  /// Finds where this tile's points of the frame before are on the next: of all subpixels that
  /// could show a point, the one nearest to where it was seen. `columns` have the tile's rays.
  void project(const Tile& tile, std::span<const reprojection::Column> columns);
  /// Puts what has arrived into the empty subpixels of a tile. Of points for one subpixel the one
  /// nearest to the eye is taken. While anything moves, none is that lies behind what is seen
  /// beside it, or at the panel's border: it may show through a gap, or be hidden by what comes. A
  /// point that lies beside its ray or row shows what belongs there: it is not taken where codes
  /// beside it, in its channel, say that this is wrong by more than `agreement`.
  void take(const Tile& tile, float agreement, std::span<reprojection::Column> columns) const;
  /// Remembers the points of a tile that is finished.
  void keep(const Tile& tile, std::span<const reprojection::Column> columns);

 private:
  struct Point {
    float z = 0.0F;     ///< panel millimetres; NaN: no point
    int8_t across = 0;  ///< from the subpixel's ray, 1/127 of reach()
    int8_t down = 0;    ///< from the subpixel's row, 1/127 row
    uint8_t code = 0;
    uint8_t surface = 0;
  };
  /// Of one channel: lens_y and tan_y of a row.
  struct RowPlanes {
    double lens_y = 0.0, lens_y_step = 0.0;
    double tan_y = 0.0, tan_y_step = 0.0;
  };
  /// Where a point is on the next frame: the subpixel, row -1 for none, and the place beside it.
  struct Place {
    int row = -1;
    int subpixel = 0;
    double across_mm = 0.0;
    double down = 0.0;
  };
  [[nodiscard]] size_t index(int row, int subpixel) const {
    return static_cast<size_t>(row) * static_cast<size_t>(plan_.row_subpixels()) +
           static_cast<size_t>(subpixel);
  }
  void project_point(int row, int subpixel, float glass_x, float tan);
  [[nodiscard]] Place place(const Vec3& point, double glass_x, double tan, int channel) const;
  /// How far beside its ray a point may lie, millimetres.
  [[nodiscard]] double reach(double z) const;
  /// Depth of what arrived at a subpixel; -infinity for nothing, NaN beside the panel.
  [[nodiscard]] float depth(int row, int subpixel) const;
  [[nodiscard]] bool agrees(int row, int subpixel, const Point& point, float agreement) const;
  [[nodiscard]] bool may_be_hidden(int row, int subpixel, float z) const;

  const optics::OpticalModel& model_;
  const TilePlan& plan_;
  LensNumbers lenses_;
  std::array<RowPlanes, 3> planes_;
  double slot_tan_ = 0.0;
  int slant_step_ = 0;  ///< subpixels to the left from a row to the next
  Affine next_from_last_;
  bool still_ = false;  ///< nothing moves: every point is where it was
  std::vector<Point> last_, next_;
  /// Of what arrived, the least: depth in the upper half, nearer is less, and the index of the
  /// point below, so that it does not matter who comes first.
  std::unique_ptr<std::atomic<uint64_t>[]> arrived_;
};

}  // namespace lenticule::render
