// SPDX-License-Identifier: Apache-2.0
// PointHistory re-projects the points of the previous frame to the next frame.
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
#include "render/options/render_options.h"
#include "render/rays/tile.h"
#include "render/scene/stage.h"

namespace lenticule::render {

/// PointHistory stores 24 bytes per subpixel of the panel. After begin(), a frame makes three
/// passes over all tiles: project(), take(), keep(). Each pass may run on any number of threads,
/// and must be complete before the next pass.
class PointHistory {
 public:
  /// Lifetime: `model` and `plan` must outlive the object.
  PointHistory(const optics::OpticalModel& model, const TilePlan& plan);

  /// Begins a frame. `next_from_last` is the motion of the scene on the panel since the previous
  /// frame.
  void begin(const Affine& next_from_last);
  /// Re-projects this tile's points of the previous frame. A point goes to the subpixel, among
  /// those that could show the point, nearest to the point's previous view. `columns` hold the
  /// tile's rays.
  void project(const Tile& tile, std::span<const reprojection::Column> columns);
  /// Fills the empty subpixels of a tile with the points that have arrived. If several points
  /// arrived at a subpixel, the one nearest to the eye is taken. While the scene moves, a point is
  /// rejected if it lies behind the points beside it, or at the panel's border: it may be visible
  /// through a gap, or be occluded by new content. A point that lies beside its subpixel's ray or
  /// row has the colour of another place: it is rejected if the codes beside it, in its channel,
  /// differ from it by more than `agreement`.
  void take(const Tile& tile, float agreement, std::span<reprojection::Column> columns) const;
  /// Stores the points of a finished tile.
  void keep(const Tile& tile, std::span<const reprojection::Column> columns);

 private:
  struct Point {
    float z = 0.0F;     ///< panel millimetres; NaN if there is no point
    int8_t across = 0;  ///< offset from the subpixel's ray, in 1/127 of reach()
    int8_t down = 0;    ///< offset from the subpixel's row, in 1/127 row
    uint8_t code = 0;
    uint8_t surface = 0;
  };
  /// lens_y and tan_y of the rows of one channel.
  struct RowPlanes {
    double lens_y = 0.0, lens_y_step = 0.0;
    double tan_y = 0.0, tan_y_step = 0.0;
  };
  /// Place is the place of a point on the next frame: the subpixel (row -1 for none) and the offset
  /// from it.
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
  void project_point(int row, int subpixel, float panel_x, float tan);
  [[nodiscard]] Place place(const Vec3& point, double panel_x, double tan, int channel) const;
  /// Returns the largest distance of a point from its ray, in millimetres.
  [[nodiscard]] double reach(double z) const;
  /// Returns the depth of the point that arrived at a subpixel; -infinity for none, NaN outside the
  /// panel.
  [[nodiscard]] float depth(int row, int subpixel) const;
  [[nodiscard]] bool agrees(int row, int subpixel, const Point& point, float agreement) const;
  [[nodiscard]] bool may_be_hidden(int row, int subpixel, float z) const;

  const optics::OpticalModel& model_;
  const TilePlan& plan_;
  LensNumbers lenses_;
  std::array<RowPlanes, 3> planes_;
  double slot_tan_ = 0.0;
  int slant_step_ = 0;  ///< subpixels to the left from one row to the next
  Affine next_from_last_;
  bool still_ = false;  ///< the scene does not move: every point keeps its place
  std::vector<Point> last_, next_;
  /// Per subpixel the minimum of all arrived keys: a depth in the upper half (nearer is less) and
  /// the point's index in the lower half, so that the result does not depend on the order of
  /// arrival.
  std::unique_ptr<std::atomic<uint64_t>[]> arrived_;
};

}  // namespace lenticule::render
