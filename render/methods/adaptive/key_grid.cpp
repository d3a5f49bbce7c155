// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/key_grid.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace lenticule::render {
namespace {

/// Returns the largest distance that a point moves on the panel between neighbouring views.
double furthest_move(const RowPlanes& planes, const Stage& stage, double eye_step) {
  double most = 0.0;
  for (const double z : {stage.near_mm, stage.far_mm}) {
    const double wider =
        planes.inverse_z() > 0.0 ? z * planes.inverse_z() / (1.0 - z * planes.inverse_z()) : z;
    if (std::isfinite(wider)) most = std::max(most, std::abs(wider) * eye_step);
  }
  return most;
}

}  // namespace

/// Evaluates three rows, since the others lie between them.
RayReach reach_of(const RowPlanes& planes) {
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

KeySpacing spacing_for(const RowPlanes& planes, const RayReach& reach, bool shiny) {
  const double furthest_apart = shiny ? 0.18 : 0.22;  // radians
  constexpr double kMostPictures = 16.0;
  const double wide = reach.eyes.width() * (planes.inverse_z() > 0.0 ? planes.inverse_z() : 1.0);
  const double apart = std::clamp(std::ceil(wide / furthest_apart - 0.1), 1.0, kMostPictures - 1.0);
  return {.row_step = 4, .columns = 5.0, .pictures = 1 + static_cast<int>(apart)};
}

KeyGrid::KeyGrid(const RowPlanes& planes, const Stage& stage, const RayReach& reach,
                 const KeySpacing& spacing)
    : planes_(&planes), row_step_(spacing.row_step) {
  LENTICULE_CHECK(spacing.pictures >= 2 && spacing.row_step >= 1 && spacing.columns > 0.0);
  const optics::Panel& panel = planes.model().rig().panel;
  eye_first_ = reach.eyes.low;
  eyes_ = reach.eyes.widened(0.5 * reach.eyes.width());
  eye_step_ = std::max(reach.eyes.width() / (spacing.pictures - 1), 1e-6);
  x_step_ = spacing.columns * panel.pixel_width.value;
  // Rounded up to whole steps, so that sample positions stay the same when the nearest object moves
  // slightly.
  const double aside = x_step_ * std::ceil(std::min(furthest_move(planes, stage, eye_step_),
                                                    reach.panel_mm.width() / 4) /
                                           x_step_);
  x_first_ = reach.panel_mm.low - aside - x_step_;
  const int columns =
      static_cast<int>(std::ceil((reach.panel_mm.width() + 2.0 * aside) / x_step_)) + 3;
  constexpr int kPadding = 16;
  rows_ = (planes.rows() - 1 + row_step_ / 2) / row_step_ + 2;
  height_px_ = planes.height_in_row(0);
  const double inverse_z = planes.inverse_z();
  constexpr double kNear = 0.027;  // radians, a degree and a half
  const double angle = eye_step_ * (inverse_z > 0.0 ? inverse_z : 1.0);
  lookup_ = {.x_first = static_cast<float>(x_first_),
             .columns_per_mm = static_cast<float>(1.0 / x_step_),
             .eye_first = static_cast<float>(eye_first_),
             .eye_step = static_cast<float>(eye_step_),
             .pictures_per_eye = static_cast<float>(1.0 / eye_step_),
             .near = static_cast<float>(std::min(kNear / angle, 0.5)),
             .inverse_z = static_cast<float>(inverse_z),
             .distance = inverse_z > 0.0 ? static_cast<float>(1.0 / inverse_z) : 0.0F,
             .pictures = spacing.pictures,
             .columns = columns,
             .stride = (columns + kPadding) / kPadding * kPadding};
}

KeyGrid::Between KeyGrid::between(int panel_row) const {
  Between between{};
  for (const int odd : {0, 1}) {
    const int from_first = panel_row + odd * (row_step_ / 2);
    between.above[odd] = from_first / row_step_;
    between.part[odd] = static_cast<float>(from_first % row_step_) / static_cast<float>(row_step_);
  }
  return between;
}

int KeyGrid::panel_row(int row, int picture) const {
  return std::clamp(row * row_step_ - picture % 2 * (row_step_ / 2), 0, planes_->rows() - 1);
}

bool KeyGrid::is_same(const KeyGrid& other) const {
  return rows_ == other.rows_ && columns() == other.columns() && pictures() == other.pictures() &&
         row_step_ == other.row_step_ && x_first_ == other.x_first_ && x_step_ == other.x_step_ &&
         eye_first_ == other.eye_first_ && eye_step_ == other.eye_step_;
}

PanelRay KeyGrid::ray(int row, int picture, int column) const {
  const int odd = picture % 2;
  const RowPlane plane = planes_->plane_at(row * row_step_ - odd * (row_step_ / 2) + height_px_);
  const double x = x_first_ + (column - 0.5 * odd) * x_step_;
  const double eye = eye_first_ + picture * eye_step_;
  const double inverse_z = planes_->inverse_z();
  const double tan = inverse_z > 0.0 ? (eye - x) * inverse_z : eye;
  return {.x_mm = x, .y_mm = plane.lens_y_mm, .tan_x = tan, .tan_y = plane.tan_y};
}

}  // namespace lenticule::render
