// SPDX-License-Identifier: Apache-2.0
#include "render/rays/primary_rays.h"

#include <algorithm>
#include <cmath>

namespace lenticule::render {
namespace {

bool subpixels_are_stacked(const optics::SubpixelLayout& layout) {
  return layout.name() == "vrgb" || layout.name() == "vbgr";
}

}  // namespace

std::vector<SubpixelPlace> footprint_samples(int count) {
  if (count <= 1) return {{0.0, 0.0}};
  std::vector<SubpixelPlace> places;
  double mean_y = 0.0;
  for (int i = 0; i < count; ++i) {
    places.push_back({(i + 0.5) / count - 0.5, radical_inverse(static_cast<unsigned>(i))});
    mean_y += places.back().y / count;
  }
  // The mean is subtracted, so that the number of samples does not shift the picture.
  for (SubpixelPlace& place : places) place.y -= mean_y;
  return places;
}

Footprint::Footprint(const optics::OpticalModel& model, SubpixelPlace place)
    : centred_(place.x == 0.0 && place.y == 0.0 && place.lens == 0.0),
      gap_mm_(model.rig().sheet.gap.value),
      shape_(1.0 - model.rig().sheet.refraction_shape),
      across_lens_mm_(place.lens * model.pitch_mm()) {
  const optics::Rig& rig = model.rig();
  const double pixel_width = rig.panel.pixel_width.value;
  const double pixel_height = rig.panel.pixel_height.value;
  const bool stacked = subpixels_are_stacked(rig.panel.layout);
  const double dx = place.x * pixel_width * (stacked ? 1.0 : 1.0 / 3.0);
  const double rows_down = place.y * (stacked ? 1.0 / 3.0 : 1.0);
  // The row of the lens point follows from the row of the panel point by the ratio of their
  // distances to the eye.
  const double distance = rig.viewing.distance.value;
  const double lens_rows_down =
      std::isinf(distance) ? rows_down : rows_down * distance / (distance + gap_mm_);
  lens_dy_mm_ = -lens_rows_down * pixel_height;
  lens_dx_mm_ = -lens_rows_down * rig.sheet.slant * pixel_width;
  shift_dx_mm_ = lens_dx_mm_ - dx;
  tan_per_mm_ = std::isinf(distance) ? 0.0 : -1.0 / distance;
}

PanelRay Footprint::moved(const PanelRay& centre) const {
  PanelRay ray = through_apex(centre);
  ray.x_mm += across_lens_mm_;
  ray.tan_x += across_lens_mm_ * tan_per_mm_;
  return ray;
}

PanelRay Footprint::through_apex(const PanelRay& centre) const {
  PanelRay ray;
  ray.x_mm = centre.x_mm + lens_dx_mm_;
  ray.y_mm = centre.y_mm + lens_dy_mm_;
  ray.tan_y = centre.tan_y + lens_dy_mm_ * tan_per_mm_;
  ray.tan_x = centre.tan_x;
  if (!(gap_mm_ > 0.0)) return ray;
  // Applies the sheet's refraction law to the centre ray to get Delta_x / g, adds the displacement,
  // and solves the law for the new tangent.
  const double squares = centre.tan_x * centre.tan_x + centre.tan_y * centre.tan_y;
  const double shift = centre.tan_x / std::sqrt(1.0 + shape_ * squares) + shift_dx_mm_ / gap_mm_;
  const double denominator = 1.0 - shape_ * shift * shift;
  if (denominator > 0.0)
    ray.tan_x = shift * std::sqrt((1.0 + shape_ * ray.tan_y * ray.tan_y) / denominator);
  return ray;
}

Interval operator*(Interval a, Interval b) {
  Interval product;
  for (const double factor : {a.low, a.high}) {
    product.extend(factor * b.low);
    product.extend(factor * b.high);
  }
  return product;
}

void Beam::extend(const Beam& other) {
  x_mm.extend(other.x_mm);
  tan_x.extend(other.tan_x);
  y_mm.extend(other.y_mm);
  tan_y.extend(other.tan_y);
  start_mm = other.start_mm;
}

namespace {

bool subpixels_are_side_by_side(const optics::SubpixelLayout& layout) {
  return layout.name() == "rgb" || layout.name() == "bgr";
}

BeamSize beam_of(const optics::Rig& rig) {
  const double pixel_mm = rig.panel.pixel_width.value;
  const double subpixel_mm =
      subpixels_are_side_by_side(rig.panel.layout) ? pixel_mm / 3.0 : pixel_mm;
  const double gap_mm = rig.sheet.gap.value;
  // A lens no wider than a pixel shows a single view; there is no neighbouring one.
  const bool has_views = gap_mm > 0.0 && rig.sheet.pitch.value > 3.0;
  return {.lens_mm = rig.sheet.pitch.value * pixel_mm / 3.0,
          .row_mm = rig.panel.pixel_height.value,
          .subpixels_per_gap = has_views ? subpixel_mm / gap_mm : 0.0,
          .inverse_distance = 1.0 / rig.viewing.distance.value};
}

int ceiling_quotient(int a, int b) { return (a + b - 1) / b; }

}  // namespace

TilePlan::TilePlan(const optics::Rig& rig)
    : width_(rig.panel.width_px), height_(rig.panel.height_px), beam_(beam_of(rig)) {
  // If the three subpixels of a pixel are not thirds of a row, columns move by whole pixels.
  const int step = subpixels_are_side_by_side(rig.panel.layout) ? 1 : 3;
  for (int row = 0; row < kRows; ++row)
    shifts_[static_cast<size_t>(row)] =
        step * static_cast<int>(std::lround(3.0 * rig.sheet.slant * row / step));
  const int drift = shifts_.back();
  first_column_ = std::min(0, drift);
  bands_ = ceiling_quotient(height_, kRows);
  per_band_ = ceiling_quotient(row_subpixels() + std::abs(drift), kColumns);
}

Tile TilePlan::tile(int index) const {
  const int row_begin = index / per_band_ * kRows;
  return {.row_begin = row_begin,
          .rows = std::min(kRows, height_ - row_begin),
          .column_begin = first_column_ + index % per_band_ * kColumns,
          .columns = kColumns};
}

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
