// SPDX-License-Identifier: Apache-2.0
// Computes the deformed grating and its position in space.
#include "calib/simulation/sheet_shape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "calib/simulation/portable_random.h"

namespace lenticule::calib {
namespace {

constexpr int kWaves = 6;
constexpr double kMostPeriods = 3.0;
constexpr int kFieldGrid = 65;  // points per side, for the plane and the largest value of a field
constexpr double kBubbleCellMm = 1.0;

/// Returns the position of a grid point, from -1 to 1. The points are the middles of equal cells,
/// so that their mean is the mean over the area.
double place_on_grid(int index) {
  return (2.0 * index + 1.0) / kFieldGrid - 1.0;
}

}  // namespace

SmoothField::SmoothField(double amplitude, uint64_t seed) {
  if (amplitude == 0.0) return;
  PortableRandom random(seed);
  for (int i = 0; i < kWaves; ++i) {
    const double most = std::numbers::pi * kMostPeriods / std::numbers::sqrt2;
    const double x = random.uniform(-most, most);
    const double y = random.uniform(-most, most);
    const double phase = random.uniform(0.0, 2.0 * std::numbers::pi);
    waves_.push_back({x, y, phase, random.uniform(0.3, 1.0)});
  }
  remove_plane_and_scale(amplitude);
}

SmoothField::Value SmoothField::waves_at(double x, double y) const {
  Value sum;
  for (const Wave& wave : waves_) {
    const double angle = wave.x * x + wave.y * y + wave.phase;
    const double sine = wave.amplitude * std::sin(angle);
    sum.value += wave.amplitude * std::cos(angle);
    sum.slope_x -= wave.x * sine;
    sum.slope_y -= wave.y * sine;
  }
  return sum;
}

/// Removes the least-squares plane. The three functions 1, x, y are orthogonal over the grid, so no
/// equations have to be solved.
void SmoothField::remove_plane_and_scale(double amplitude) {
  double squares = 0.0;
  for (int row = 0; row < kFieldGrid; ++row) {
    for (int column = 0; column < kFieldGrid; ++column) {
      const double x = place_on_grid(column);
      const double y = place_on_grid(row);
      const double value = waves_at(x, y).value;
      constant_ += value / (kFieldGrid * kFieldGrid);
      linear_x_ += value * x;
      linear_y_ += value * y;
      squares += x * x;
    }
  }
  linear_x_ /= squares;
  linear_y_ /= squares;
  double largest = 0.0;
  for (int row = 0; row < kFieldGrid; ++row) {
    for (int column = 0; column < kFieldGrid; ++column) {
      const Value value = at(place_on_grid(column), place_on_grid(row));
      largest = std::max(largest, std::abs(value.value));
    }
  }
  const double scale = amplitude / largest;
  for (Wave& wave : waves_) wave.amplitude *= scale;
  constant_ *= scale;
  linear_x_ *= scale;
  linear_y_ *= scale;
}

SmoothField::Value SmoothField::at(double x, double y) const {
  Value value = waves_at(x, y);
  value.value -= constant_ + linear_x_ * x + linear_y_ * y;
  value.slope_x -= linear_x_;
  value.slope_y -= linear_y_;
  return value;
}

SheetShape::SheetShape(const optics::Panel& panel, const SimulatedSheet& sheet,
                       double thermal_stretch)
    : panel_(panel),
      sheet_(sheet),
      half_width_mm_(panel.width_px * panel.pixel_width.value / 2.0),
      half_height_mm_(panel.height_px * panel.pixel_height.value / 2.0),
      deformation_(sheet.deformation_lenses, sheet.seed) {
  const double pitch_px = sheet.pitch_subpx / 3.0 * (1.0 + thermal_stretch);
  // Down is -y: an apex line that moves left going down moves right going up.
  gradient_ = {1.0 / (pitch_px * panel.pixel_width.value),
               -sheet.slant / (pitch_px * panel.pixel_height.value)};
  if (sheet.bubbles > 0.0 || sheet.scratches > 0) scatter_bubbles();
}

LocalLenses SheetShape::lenses_at(Vec2 point, int channel) const {
  const double x = point.x / half_width_mm_;
  const double y = point.y / half_height_mm_;
  const SmoothField::Value deformed = deformation_.at(x, y);
  LocalLenses local;
  local.coordinate =
      gradient_.x * point.x + gradient_.y * point.y + sheet_.offset_lenses + deformed.value;
  local.gradient = {gradient_.x + deformed.slope_x / half_width_mm_,
                    gradient_.y + deformed.slope_y / half_height_mm_};
  // 1/3 is the mean of (x^2 + y^2) / 2 over the panel.
  const double thicker = 1.0 + sheet_.gap_bow * (1.0 / 3.0 - (x * x + y * y) / 2.0);
  local.stack = {1.0 / std::hypot(local.gradient.x, local.gradient.y),
                 sheet_.radius_mm,
                 sheet_.thickness_mm * thicker,
                 sheet_.air_gap_mm * thicker,
                 sheet_.index[static_cast<size_t>(channel)],
                 sheet_.lens_toward_panel};
  return local;
}

Stance SheetShape::stance_at(Vec2 point) const {
  Stance stance;
  stance.point = {point.x, point.y, 0};
  const double radius = sheet_.curve_radius_mm;
  if (radius == 0.0) return stance;
  const double angle = point.x / radius;
  const double sine = std::sin(angle);
  const double half_sine = std::sin(angle / 2.0);
  stance.point = {radius * sine, point.y, 2.0 * radius * half_sine * half_sine};
  stance.tangent = {std::cos(angle), 0, sine};
  stance.normal = {-sine, 0, std::cos(angle)};
  return stance;
}

std::optional<Vec2> SheetShape::meet(Vec3 from, Vec3 direction) const {
  if (!(direction.z < 0)) return std::nullopt;
  const double radius = sheet_.curve_radius_mm;
  if (radius == 0.0) {
    const double along = -from.z / direction.z;
    return Vec2{from.x + along * direction.x, from.y + along * direction.y};
  }
  // The axis of the bend is the line x = 0, z = radius; the panel is the side far from the viewer.
  const double z = from.z - radius;
  const double a = direction.x * direction.x + direction.z * direction.z;
  const double b = from.x * direction.x + z * direction.z;
  const double discriminant = b * b - a * (from.x * from.x + z * z - radius * radius);
  if (discriminant < 0) return std::nullopt;
  const double along = (-b + std::sqrt(discriminant)) / a;
  const double angle = std::atan2(from.x + along * direction.x, -(z + along * direction.z));
  return Vec2{radius * angle, from.y + along * direction.y};
}

void SheetShape::scatter_bubbles() {
  bubble_columns_ = std::max(1, static_cast<int>(2.0 * half_width_mm_ / kBubbleCellMm));
  bubble_rows_ = std::max(1, static_cast<int>(2.0 * half_height_mm_ / kBubbleCellMm));
  bubbly_.assign(static_cast<size_t>(bubble_columns_) * static_cast<size_t>(bubble_rows_), 0);
  const auto wanted = static_cast<ptrdiff_t>(sheet_.bubbles * static_cast<double>(bubbly_.size()));
  PortableRandom random(sheet_.seed ^ 0x6275626273ULL);
  // The limit is high enough for every fraction below 1, and ends the loop for other fractions.
  for (int tries = 0; tries < 100000; ++tries) {
    if (std::count(bubbly_.begin(), bubbly_.end(), 1) >= wanted) break;
    const double x = random.uniform(-half_width_mm_, half_width_mm_);
    const double y = random.uniform(-half_height_mm_, half_height_mm_);
    mark_bubble({{x, y}, random.uniform(1.5, 6.0)});
  }
  scratch();
}

void SheetShape::mark_bubble(const Bubble& bubble) {
  for (int row = 0; row < bubble_rows_; ++row) {
    for (int column = 0; column < bubble_columns_; ++column) {
      const double x = ((column + 0.5) / bubble_columns_ * 2.0 - 1.0) * half_width_mm_;
      const double y = ((row + 0.5) / bubble_rows_ * 2.0 - 1.0) * half_height_mm_;
      if (std::hypot(x - bubble.centre.x, y - bubble.centre.y) > bubble.radius) continue;
      bubbly_[static_cast<size_t>(row) * static_cast<size_t>(bubble_columns_) +
              static_cast<size_t>(column)] = 1;
    }
  }
}

/// Marks scratches between random points, each through the cells that it crosses.
void SheetShape::scratch() {
  PortableRandom random(sheet_.seed ^ 0x73637261746368ULL);
  const auto anywhere = [&] {
    return Vec2{random.uniform(-half_width_mm_, half_width_mm_),
                random.uniform(-half_height_mm_, half_height_mm_)};
  };
  for (int n = 0; n < sheet_.scratches; ++n) {
    const Vec2 from = anywhere();
    const Vec2 way = anywhere() - from;
    const int steps = 1 + static_cast<int>(2.0 * std::hypot(way.x, way.y) / kBubbleCellMm);
    for (int step = 0; step <= steps; ++step)
      mark_cell(from + way * (static_cast<double>(step) / steps));
  }
}

void SheetShape::mark_cell(Vec2 point) {
  const auto cell = [](double place, double half, int count) {
    return std::clamp(static_cast<int>((place / half + 1.0) / 2.0 * count), 0, count - 1);
  };
  const int column = cell(point.x, half_width_mm_, bubble_columns_);
  const int row = cell(point.y, half_height_mm_, bubble_rows_);
  bubbly_[static_cast<size_t>(row) * static_cast<size_t>(bubble_columns_) +
          static_cast<size_t>(column)] = 1;
}

bool SheetShape::in_bubble(Vec2 point) const {
  if (bubbly_.empty()) return false;
  const double column = (point.x / half_width_mm_ + 1.0) / 2.0 * bubble_columns_;
  const double row = (point.y / half_height_mm_ + 1.0) / 2.0 * bubble_rows_;
  if (!(column >= 0 && column < bubble_columns_ && row >= 0 && row < bubble_rows_)) return false;
  return bubbly_[static_cast<size_t>(row) * static_cast<size_t>(bubble_columns_) +
                 static_cast<size_t>(column)] != 0;
}

}  // namespace lenticule::calib
