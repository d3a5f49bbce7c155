// SPDX-License-Identifier: Apache-2.0
#include "render/primary_rays.h"

#include <algorithm>
#include <cmath>

namespace lenticule::render {

PrimaryRays::PrimaryRays(const optics::OpticalModel& model, const TilePlan& plan)
    : plan_(plan), evaluator_(model), distance_mm_(model.rig().viewing.distance.value) {}

/// Where rays start: just before the nearest surface, and before the eye.
double PrimaryRays::start_mm(const Scene::Impl& scene) const {
  const double clear_of_scene = scene.near_mm + 1e-5 * std::abs(scene.near_mm) + 1e-2;
  return std::min(clear_of_scene, kNearestContent * distance_mm_);
}

void PrimaryRays::generate(const Scene::Impl& scene, const Tile& tile, const Footprint& footprint,
                           double weight, Workspace& workspace, std::vector<PathRay>& rays) const {
  const double start = start_mm(scene);
  const Affine& scene_from_panel = scene.scene_from_panel;
  rays.assign(static_cast<size_t>(tile.columns) * TilePlan::kRows, PathRay{});
  for (int row = 0; row < tile.rows; ++row) {
    const int first = plan_.subpixel(tile, 0, row);
    const int begin = std::max(first, 0);
    const int end = std::min(first + tile.columns, plan_.row_subpixels());
    if (begin >= end) continue;
    const int i_begin = begin / 3;
    evaluator_.evaluate(tile.row_begin + row, i_begin, (end + 2) / 3, workspace.row);
    for (int s = begin; s < end; ++s) {
      const auto k = static_cast<size_t>(s - 3 * i_begin);
      const PanelRay line =
          footprint.displaced({workspace.row.lens_x_mm[k], workspace.row.lens_y_mm[k],
                               workspace.row.tan_x[k], workspace.row.tan_y[k]});
      const auto column = static_cast<uint32_t>(s - first);
      PathRay& ray = rays[column * TilePlan::kRows + static_cast<uint32_t>(row)];
      ray.origin = scene_from_panel.point(
          {line.x_mm + start * line.tan_x, line.y_mm + start * line.tan_y, start});
      ray.direction = normalized(scene_from_panel.vector({-line.tan_x, -line.tan_y, -1.0}));
      ray.weight = weight;
      ray.target = static_cast<uint32_t>(row) * static_cast<uint32_t>(tile.columns) + column;
      ray.channel = s % 3;
    }
  }
}

}  // namespace lenticule::render
