// SPDX-License-Identifier: Apache-2.0
#include "render/methods/reuse/point_history.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "render/rays/primary_rays.h"

namespace lenticule::render {
namespace {

using reprojection::Column;

constexpr float kNoPoint = std::numeric_limits<float>::quiet_NaN();
constexpr uint64_t kNothing = ~uint64_t{0};
constexpr double kSteps = 127.0;

/// Maps a float to an integer with the same order, for both signs.
uint32_t ordered(float value) {
  const auto bits = std::bit_cast<uint32_t>(value);
  return (bits >> 31) != 0 ? ~bits : bits | 0x80000000U;
}
float from_ordered(uint32_t order) {
  return std::bit_cast<float>((order >> 31) != 0 ? order & 0x7FFFFFFFU : ~order);
}

int8_t stepped(double part) {
  return static_cast<int8_t>(std::lround(std::clamp(part, -1.0, 1.0) * kSteps));
}

}  // namespace

PointHistory::PointHistory(const optics::OpticalModel& model, const TilePlan& plan)
    : model_(model), plan_(plan), lenses_(model, plan) {
  const optics::Rig& rig = model.rig();
  const int last_row = rig.panel.height_px - 1;
  for (int channel = 0; channel < 3; ++channel) {
    const optics::SubpixelRay top = model.ray(rig.panel.width_px / 2, 0, channel);
    const optics::SubpixelRay bottom = model.ray(rig.panel.width_px / 2, last_row, channel);
    const double rows = std::max(last_row, 1);
    planes_[static_cast<size_t>(channel)] = {
        .lens_y = top.lens_y_mm,
        .lens_y_step = last_row > 0 ? (bottom.lens_y_mm - top.lens_y_mm) / rows : -1.0,
        .tan_y = top.tan_y,
        .tan_y_step = (bottom.tan_y - top.tan_y) / rows};
  }
  const double gap_mm = rig.sheet.gap.value;
  slot_tan_ = gap_mm > 0.0 ? rig.panel.pixel_width.value / gap_mm : 0.0;
  slant_step_ = static_cast<int>(std::lround(3.0 * rig.sheet.slant));
  const size_t subpixels =
      static_cast<size_t>(plan.row_subpixels()) * static_cast<size_t>(rig.panel.height_px);
  last_.resize(subpixels);
  next_.resize(subpixels, Point{.z = kNoPoint});
  arrived_ = std::make_unique<std::atomic<uint64_t>[]>(subpixels);
}

double PointHistory::reach(double z) const {
  return model_.pitch_mm() + std::abs(z) * slot_tan_;
}

void PointHistory::begin(const Affine& next_from_last) {
  next_from_last_ = next_from_last;
  const auto is_near = [](const Vec3& a, const Vec3& b) { return length(a - b) < 1e-9; };
  const Affine same;
  still_ = is_near(next_from_last.column_x, same.column_x) &&
           is_near(next_from_last.column_y, same.column_y) &&
           is_near(next_from_last.column_z, same.column_z) &&
           is_near(next_from_last.origin, same.origin);
  std::swap(last_, next_);
  for (size_t i = 0; i < last_.size(); ++i) arrived_[i].store(kNothing, std::memory_order_relaxed);
}

void PointHistory::project(const Tile& tile, std::span<const Column> columns) {
  for (int lane = 0; lane < tile.rows; ++lane)
    for (int c = 0; c < tile.columns; ++c) {
      const Column& column = columns[static_cast<size_t>(c)];
      if (column.flag[lane] != reprojection::kOutside)
        project_point(tile.row_begin + lane, plan_.subpixel(tile, c, lane), column.panel_x[lane],
                      column.tan[lane]);
    }
}

void PointHistory::project_point(int row, int subpixel, float panel_x, float tan) {
  const size_t source = index(row, subpixel);
  Point& point = last_[source];
  if (!(point.z == point.z)) return;
  const int channel = subpixel % 3;
  const RowPlanes& plane = planes_[static_cast<size_t>(channel)];
  const double z = double{point.z};
  const double at = row + point.down / kSteps;
  const double lens_y = plane.lens_y + at * plane.lens_y_step;
  const double tan_y = plane.tan_y + at * plane.tan_y_step;
  const Vec3 moved =
      next_from_last_.point({double{panel_x} + double{tan} * z + point.across / kSteps * reach(z),
                             lens_y + tan_y * z, z});
  const Place to = place(moved, double{panel_x}, double{tan}, channel);
  point.z = kNoPoint;
  if (to.row < 0) return;
  point.z = static_cast<float>(moved.z);
  point.across = stepped(to.across_mm / reach(moved.z));
  point.down = stepped(to.down);
  const uint64_t arrival = uint64_t{ordered(-point.z)} << 32 | static_cast<uint64_t>(source);
  std::atomic<uint64_t>& slot = arrived_[index(to.row, to.subpixel)];
  uint64_t there = slot.load(std::memory_order_relaxed);
  while (arrival < there &&
         !slot.compare_exchange_weak(there, arrival, std::memory_order_relaxed)) {
  }
}

PointHistory::Place PointHistory::place(const Vec3& point, double panel_x, double tan,
                                        int channel) const {
  const optics::Rig& rig = model_.rig();
  const double distance = rig.viewing.distance.value;
  if (!is_finite(point) || !(point.z < kNearestContent * distance)) return {};
  const RowPlanes& plane = planes_[static_cast<size_t>(channel)];
  const double row_at = (point.y - plane.lens_y - point.z * plane.tan_y) /
                        (plane.lens_y_step + point.z * plane.tan_y_step);
  if (!(row_at > -0.5) || !(row_at < rig.panel.height_px - 0.5)) return {};
  const int row = static_cast<int>(std::lround(row_at));

  // Among all rays through the point, takes the one nearest to the point's previous view, measured
  // in lenses and in slots: near the panel this is the same direction, far from it the same lens.
  const double pitch = model_.pitch_mm();
  const double slot = point.z * slot_tan_;
  const double off = (point.x - panel_x - point.z * tan) / (pitch * pitch + slot * slot);
  const double tan_x = tan + off * slot * slot_tan_;
  const double near_x = panel_x + off * pitch * pitch;
  const LensNumbers::Line lens = lenses_.line_at(row, channel, near_x);
  const double number = std::round(lens.offset + lens.per_mm * near_x);
  const double lens_x = (number - lens.offset) / lens.per_mm;

  // Panel point from which this ray comes, by the shift due to refraction.
  const double tan_y = plane.tan_y + row * plane.tan_y_step;
  const double bend = 1.0 - rig.sheet.refraction_shape;
  const double square = 1.0 + bend * (tan_x * tan_x + tan_y * tan_y);
  const double x_px = rig.panel.x_px(lens_x - rig.sheet.gap.value * tan_x / std::sqrt(square));
  const int cell = std::clamp(static_cast<int>(std::floor(x_px)), 0, rig.panel.width_px - 1);
  const double ideal = x_px - rig.panel.layout.offset(cell, row, channel).x_px;
  if (!(ideal > -0.5) || !(ideal < rig.panel.width_px - 0.5)) return {};
  const int pixel = static_cast<int>(std::lround(ideal));
  const double shift_per_tan =
      rig.sheet.gap.value * (1.0 + bend * tan_y * tan_y) / (square * std::sqrt(square));
  const double slot_turn =
      shift_per_tan > 0.0 ? (ideal - pixel) * rig.panel.pixel_width.value / shift_per_tan : 0.0;
  return {.row = row,
          .subpixel = 3 * pixel + channel,
          .across_mm = point.x - lens_x - (tan_x + slot_turn) * point.z,
          .down = row_at - row};
}

float PointHistory::depth(int row, int subpixel) const {
  if (row < 0 || row >= model_.rig().panel.height_px || subpixel < 0 ||
      subpixel >= plan_.row_subpixels())
    return kNoPoint;
  const uint64_t arrival = arrived_[index(row, subpixel)].load(std::memory_order_relaxed);
  return arrival == kNothing ? -std::numeric_limits<float>::infinity()
                             : -from_ordered(static_cast<uint32_t>(arrival >> 32));
}

/// Returns true if a nearer point, or the panel's border, lies beside the place, so that new
/// content may occlude the point. Outlines move by fractions of a subpixel, and traced points start
/// at subpixel centres, so the occluding points would never arrive at the place themselves.
bool PointHistory::may_be_hidden(int row, int subpixel, float z) const {
  const auto margin = static_cast<float>(reach(double{z}));
  const auto hides = [&](int other_row, int other) {
    const float nearest = depth(other_row, other);
    return std::isnan(nearest) || nearest > z + margin;
  };
  return hides(row, subpixel - 3) || hides(row, subpixel + 3) ||
         hides(row - 1, subpixel + slant_step_) || hides(row + 1, subpixel - slant_step_);
}

bool PointHistory::agrees(int row, int subpixel, const Point& point, float agreement) const {
  const auto differs = [&](int other_row, int other, int8_t off) {
    const float z = depth(other_row, other);
    if (!std::isfinite(z)) return false;
    const uint64_t arrival = arrived_[index(other_row, other)].load(std::memory_order_relaxed);
    const int beside = last_[static_cast<size_t>(arrival & 0xFFFFFFFFU)].code;
    const double steps = std::min(1.0, 2.0 * std::abs(off) / kSteps);
    return steps * std::abs(beside - point.code) > double{agreement};
  };
  // Neighbours of the same channel, nearest to the lens's slant.
  const int left = 3 * static_cast<int>(std::lround(slant_step_ / 3.0));
  return !differs(row, subpixel - 3, point.across) && !differs(row, subpixel + 3, point.across) &&
         !differs(row - 1, subpixel + left, point.down) &&
         !differs(row + 1, subpixel - left, point.down);
}

void PointHistory::take(const Tile& tile, float agreement, std::span<Column> columns) const {
  for (int lane = 0; lane < tile.rows; ++lane)
    for (int c = 0; c < tile.columns; ++c) {
      Column& column = columns[static_cast<size_t>(c)];
      if (column.flag[lane] != reprojection::kEmpty) continue;
      const int row = tile.row_begin + lane;
      const int subpixel = plan_.subpixel(tile, c, lane);
      const uint64_t arrival = arrived_[index(row, subpixel)].load(std::memory_order_relaxed);
      if (arrival == kNothing) continue;
      const Point& point = last_[static_cast<size_t>(arrival & 0xFFFFFFFFU)];
      const double far = reach(double{point.z});
      const double across = point.across / kSteps * far;
      // Near its border, a lens ends elsewhere than the numbers of the lenses say.
      if (std::abs(across) > 0.9 * far) continue;
      if (!still_ &&
          (may_be_hidden(row, subpixel, point.z) || !agrees(row, subpixel, point, agreement)))
        continue;
      column.flag[lane] = reprojection::kProjected;
      column.z[lane] = point.z;
      column.x[lane] =
          column.panel_x[lane] + column.tan[lane] * point.z + static_cast<float>(across);
      column.down[lane] = static_cast<float>(point.down / kSteps);
      column.code[lane] = static_cast<float>(point.code);
      column.surface[lane] = point.surface == 255 ? reprojection::kSky : point.surface;
    }
}

void PointHistory::keep(const Tile& tile, std::span<const Column> columns) {
  for (int lane = 0; lane < tile.rows; ++lane)
    for (int c = 0; c < tile.columns; ++c) {
      const int subpixel = plan_.subpixel(tile, c, lane);
      if (subpixel < 0 || subpixel >= plan_.row_subpixels()) continue;
      const Column& column = columns[static_cast<size_t>(c)];
      const float z = column.z[lane];
      const double beside = double{column.x[lane]} -
                            (double{column.panel_x[lane]} + double{column.tan[lane]} * double{z});
      Point& point = next_[index(tile.row_begin + lane, subpixel)];
      point = {.z = kNoPoint};
      if (!(z == z) || column.surface[lane] < reprojection::kSky) continue;
      point = {.z = z,
               .across = stepped(beside / reach(double{z})),
               .down = stepped(double{column.down[lane]}),
               .code = static_cast<uint8_t>(column.code[lane] + 0.5F),
               .surface = static_cast<uint8_t>(column.surface[lane] & 0xFF)};
    }
}

}  // namespace lenticule::render
