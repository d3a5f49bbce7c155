// SPDX-License-Identifier: Apache-2.0
#include "render/rays/primary_rays.h"

#include <algorithm>
#include <cmath>

namespace lenticule::render {

double primary_start_mm(double nearest_surface_mm, double viewing_distance_mm) {
  const double clear_of_scene = nearest_surface_mm + 1e-5 * std::abs(nearest_surface_mm) + 1e-2;
  return std::min(clear_of_scene, kNearestContent * viewing_distance_mm);
}

PrimaryRays::PrimaryRays(const optics::OpticalModel& model, const TilePlan& plan)
    : plan_(plan), evaluator_(model), distance_mm_(model.rig().viewing.distance.value) {}

double PrimaryRays::start_mm(const Scene& scene) const {
  return primary_start_mm(scene.near_mm, distance_mm_);
}

void PrimaryRays::evaluate_rows(const Tile& tile, Workspace& workspace) const {
  for (int row = 0; row < TilePlan::kRows; ++row) {
    Workspace::Row& out = workspace.rows[static_cast<size_t>(row)];
    const int first = plan_.subpixel(tile, 0, row);
    out.begin = std::max(first, 0);
    out.end = row < tile.rows ? std::min(first + tile.columns, plan_.row_subpixels()) : out.begin;
    out.end = std::max(out.end, out.begin);
    if (out.begin == out.end) continue;
    const int i_begin = out.begin / 3;
    out.first_evaluated = 3 * i_begin;
    evaluator_.evaluate(tile.row_begin + row, i_begin, (out.end + 2) / 3, out.rays);
  }
}

PathRay PrimaryRays::ray_of(const Scene& scene, const optics::RowRays& row, size_t k,
                            const Footprint& footprint, double start) const {
  const PanelRay line =
      footprint.displaced({row.lens_x_mm[k], row.lens_y_mm[k], row.tan_x[k], row.tan_y[k]});
  const Affine& scene_from_panel = scene.scene_from_panel;
  const Vec3 way = scene_from_panel.vector({-line.tan_x, -line.tan_y, -1.0});
  return {.origin = scene_from_panel.point(
              {line.x_mm + start * line.tan_x, line.y_mm + start * line.tan_y, start}),
          .direction = way * (1.0 / length(way))};
}

PathRay PrimaryRays::one(const Scene& scene, int row, int subpixel, const Footprint& footprint,
                         optics::RowRays& scratch) const {
  const int i = subpixel / 3;
  evaluator_.evaluate(row, i, i + 1, scratch);
  return ray_of(scene, scratch, static_cast<size_t>(subpixel - 3 * i), footprint, start_mm(scene));
}

void PrimaryRays::generate(const Scene& scene, const Tile& tile, const Footprint& footprint,
                           double weight, Workspace& workspace, std::vector<PathRay>& rays) const {
  evaluate_rows(tile, workspace);
  const double start = start_mm(scene);
  rays.resize(static_cast<size_t>(tile.columns) * TilePlan::kRows);
  PathRay* ray = rays.data();
  // Goes column by column, so that packets are written sequentially.
  for (int column = 0; column < tile.columns; ++column)
    for (int row = 0; row < TilePlan::kRows; ++row, ++ray) {
      const Workspace::Row& in = workspace.rows[static_cast<size_t>(row)];
      const int s = plan_.subpixel(tile, column, row);
      if (s < in.begin || s >= in.end) {
        ray->target = PathRay::kInactive;
        continue;
      }
      const auto k = static_cast<size_t>(s - in.first_evaluated);
      *ray = ray_of(scene, in.rays, k, footprint, start);
      ray->weight = weight;
      ray->target = static_cast<uint32_t>(row * tile.columns + column);
      ray->channel = s % 3;
    }
}

}  // namespace lenticule::render
