// SPDX-License-Identifier: Apache-2.0
#include "calib/fit/residual_cells.h"

#include <limits>

#include "calib/fit/projection.h"

namespace lenticule::calib {

PanelField mean_over_cells(const View& view, const PoseValues& pose, const CameraValues& camera,
                           const std::vector<double>& rests, const optics::Panel& panel,
                           const CellGrid& grid) {
  PanelField field{.columns = grid.columns, .rows = grid.rows, .values = {}};
  const auto cells = static_cast<size_t>(field.columns * field.rows);
  std::vector<double> sums(cells, 0.0), counts(cells, 0.0);
  for (size_t n = 0; n < rests.size(); ++n) {
    const Vec2 pixel = view.phases[n].camera_px;
    const auto lens = lens_plane_point(camera.data(), pose.data(), pixel.x, pixel.y);
    const int column = static_cast<int>(panel.x_px(lens.x) / panel.width_px * field.columns);
    const int row = static_cast<int>(panel.y_px(lens.y) / panel.height_px * field.rows);
    if (column < 0 || row < 0 || column >= field.columns || row >= field.rows) continue;
    const auto cell = static_cast<size_t>(row * field.columns + column);
    sums[cell] += rests[n];
    counts[cell] += 1.0;
  }
  for (size_t cell = 0; cell < cells; ++cell)
    field.values.push_back(counts[cell] >= grid.least_blocks
                               ? sums[cell] / counts[cell]
                               : std::numeric_limits<double>::quiet_NaN());
  return field;
}

}  // namespace lenticule::calib
