// SPDX-License-Identifier: Apache-2.0
// Refracts rays at the surface of one lens and at the flat faces under or above it (vector form of
// Snell's law), places the lenses of a deformed, bent and scratched sheet, and averages the light
// that an eye sees through one lens.
#include "lab/panel/lens_sheet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include "lab/panel/portable_random.h"

namespace lenticule::lab {

namespace {

constexpr Vec3 kFlat{0, 0, 1};

/// Moves `point` along `direction` down to the plane z.
Vec3 go_to_plane(Vec3 point, Vec3 direction, double z) {
  return point + direction * ((z - point.z) / direction.z);
}

/// Incidence is a point on the surface of a lens and the direction of the arriving light.
struct Incidence {
  Vec3 point;
  Vec3 normal;  // opposite to the light
  Vec3 direction;
};

/// Traces the light behind the curved surface, down to the pixels.
std::optional<Vec2> land_from_surface(const LensStack& stack, const Incidence& at) {
  if (std::abs(at.point.x) > stack.pitch_mm / 2.0 * (1.0 - stack.valley) * (1.0 + 1e-12))
    return std::nullopt;
  const double into_gap = stack.index / stack.gap_index;
  const double ratio = stack.lens_toward_panel ? into_gap : 1.0 / stack.index;
  const std::optional<Vec3> bent = refract(at.direction, at.normal, ratio);
  if (!bent || !(bent->z < 0)) return std::nullopt;
  if (stack.lens_toward_panel) {
    const Vec3 landing = go_to_plane(at.point, *bent, -stack.gap_mm);
    return Vec2{landing.x, landing.y};
  }
  const Vec3 face = go_to_plane(at.point, *bent, -stack.thickness_mm);
  if (stack.gap_mm == 0.0) return Vec2{face.x, face.y};
  const std::optional<Vec3> out = refract(*bent, kFlat, into_gap);
  if (!out) return std::nullopt;
  const Vec3 landing = go_to_plane(face, *out, -stack.thickness_mm - stack.gap_mm);
  return Vec2{landing.x, landing.y};
}

/// Returns the point where the ray meets the cylinder whose apex is at u = 0. Its axis lies a
/// radius below the apices, or above them if they face the panel; `start` is on the plane z = 0.
std::optional<Incidence> meet_cylinder(const LensStack& stack, Vec2 start, Vec3 d) {
  const double axis_z = stack.lens_toward_panel ? stack.radius_mm : -stack.radius_mm;
  const double a = d.x * d.x + d.z * d.z;
  const double b = start.x * d.x - axis_z * d.z;
  const double c = start.x * start.x;
  const double discriminant = b * b - a * c;
  if (discriminant < 0) return std::nullopt;
  // Selects the intersection near the apex; this form is numerically stable there.
  const double root = std::sqrt(discriminant);
  const double along = stack.lens_toward_panel ? -c / (b + root) : c / (-b + root);
  const Vec3 point = Vec3{start.x, start.y, 0} + d * along;
  const double side = stack.lens_toward_panel ? -1.0 : 1.0;
  const Vec3 normal = Vec3{point.x, 0, point.z - axis_z} * (side / stack.radius_mm);
  return Incidence{point, normal, d};
}

Incidence surface_at(const LensStack& stack, double u) {
  const double depth = std::sqrt(stack.radius_mm * stack.radius_mm - u * u);
  const double sag = stack.radius_mm - depth;
  Incidence at;
  const double side = stack.lens_toward_panel ? -1.0 : 1.0;
  at.point = {u, 0, -side * sag};
  at.normal = Vec3{side * u, 0, depth} / stack.radius_mm;
  return at;
}

/// Returns the direction inside the slab of light from `eye` that reaches `point` under the slab's
/// upper face. The aim is corrected by the miss in each step: the slab bends so little that each
/// step gains two digits or more.
std::optional<Vec3> aim_through_slab(const LensStack& stack, Vec3 eye, Vec3 point) {
  Vec3 entry{point.x, point.y, stack.thickness_mm};
  std::optional<Vec3> inside;
  for (int step = 0; step < 30; ++step) {
    inside = refract(normalized(entry - eye), kFlat, 1.0 / stack.index);
    if (!inside) return std::nullopt;
    const Vec3 miss = point - go_to_plane(entry, *inside, point.z);
    entry = entry + Vec3{miss.x, miss.y, 0};
    if (std::abs(miss.x) + std::abs(miss.y) < 1e-14) break;
  }
  return inside;
}

}  // namespace

std::optional<Vec3> refract(Vec3 direction, Vec3 normal, double ratio) {
  const double cosine = -dot(direction, normal);
  if (!(cosine > 0)) return std::nullopt;
  const double squared = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
  if (!(squared > 0)) return std::nullopt;
  return direction * ratio + normal * (ratio * cosine - std::sqrt(squared));
}

std::optional<Vec2> land(const LensStack& stack, Vec2 start, Vec3 direction) {
  Vec3 d = direction;
  if (stack.lens_toward_panel) {
    const std::optional<Vec3> inside = refract(direction, kFlat, 1.0 / stack.index);
    if (!inside) return std::nullopt;
    // The upper face is a thickness above the apices; below the face the ray is steeper.
    start = start + Vec2{inside->x / -inside->z - d.x / -d.z, inside->y / -inside->z - d.y / -d.z} *
                        stack.thickness_mm;
    d = *inside;
  }
  const double half = stack.pitch_mm / 2.0;
  double apex = std::round(start.x / stack.pitch_mm) * stack.pitch_mm;
  for (int neighbour = 0; neighbour < 3; ++neighbour) {
    const std::optional<Incidence> at = meet_cylinder(stack, {start.x - apex, start.y}, d);
    if (at && std::abs(at->point.x) <= half * (1.0 + 1e-12)) {
      const std::optional<Vec2> landing = land_from_surface(stack, *at);
      if (!landing) return std::nullopt;
      return Vec2{landing->x + apex, landing->y};
    }
    const double reached = at ? at->point.x : d.x;
    apex += reached > 0 ? stack.pitch_mm : -stack.pitch_mm;
  }
  return std::nullopt;
}

std::optional<ApertureRay> aperture_ray(const LensStack& stack, double u, Vec3 eye) {
  Incidence at = surface_at(stack, u);
  std::optional<Vec3> arriving = normalized(at.point - eye);
  if (stack.lens_toward_panel) arriving = aim_through_slab(stack, eye, at.point);
  if (!arriving) return std::nullopt;
  at.direction = *arriving;
  const double facing = -dot(at.direction, at.normal) / at.normal.z / -at.direction.z;
  if (!(facing > 0)) return std::nullopt;
  const std::optional<Vec2> landing = land_from_surface(stack, at);
  if (!landing) return std::nullopt;
  return ApertureRay{*landing, facing};
}

Vec2 straight_aim(const LensStack& stack, Vec3 eye) {
  if (!stack.lens_toward_panel) return {};
  const std::optional<Vec3> inside = aim_through_slab(stack, eye, Vec3{});
  if (!inside) return {};
  const Vec3 entry = *inside * (stack.thickness_mm / inside->z);
  const Vec3 aim = go_to_plane(entry, entry - eye, 0.0);
  return {aim.x, aim.y};
}

// Computes the deformed grating and its position in space.

namespace {

constexpr int kWaves = 6;
constexpr double kMostPeriods = 3.0;
constexpr int kFieldGrid = 65;  // points per side, for the plane and the largest value of a field
constexpr double kBubbleCellMm = 1.0;

/// Returns the position of a grid point, from -1 to 1. The points are the middles of equal cells,
/// so that their mean is the mean over the area.
double place_on_grid(int index) { return (2.0 * index + 1.0) / kFieldGrid - 1.0; }

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

SmoothField::Value SheetShape::deformation_at(double x, double y) const {
  SmoothField::Value sum = deformation_.at(x, y);
  const auto& b = sheet_.bend_lenses;
  constexpr double kPi = std::numbers::pi;
  const double sine = std::sin(2.0 * kPi * x), cosine = std::cos(kPi * y);
  sum.value += b[0] * x * x + b[1] * x * y + b[2] * y * y + b[3] * x * x * x + b[4] * y * y * y +
               b[5] * sine * cosine;
  sum.slope_x += 2.0 * b[0] * x + b[1] * y + 3.0 * b[3] * x * x +
                 b[5] * 2.0 * kPi * std::cos(2.0 * kPi * x) * cosine;
  sum.slope_y +=
      b[1] * x + 2.0 * b[2] * y + 3.0 * b[4] * y * y - b[5] * kPi * sine * std::sin(kPi * y);
  return sum;
}

LocalLenses SheetShape::lenses_at(Vec2 point, int channel) const {
  const double x = point.x / half_width_mm_;
  const double y = point.y / half_height_mm_;
  const SmoothField::Value deformed = deformation_at(x, y);
  LocalLenses local;
  local.coordinate =
      gradient_.x * point.x + gradient_.y * point.y + sheet_.offset_lenses + deformed.value;
  local.gradient = {gradient_.x + deformed.slope_x / half_width_mm_,
                    gradient_.y + deformed.slope_y / half_height_mm_};
  // 1/3 is the mean of (x^2 + y^2) / 2 over the panel.
  const double thicker = 1.0 + sheet_.gap_bow * (1.0 / 3.0 - (x * x + y * y) / 2.0);
  local.stack = {.pitch_mm = 1.0 / std::hypot(local.gradient.x, local.gradient.y),
                 .radius_mm = sheet_.radius_mm,
                 .thickness_mm = sheet_.thickness_mm * thicker,
                 .index = sheet_.index[static_cast<size_t>(channel)],
                 .gap_mm = sheet_.gap_mm * thicker,
                 .gap_index = sheet_.gap_index,
                 .lens_toward_panel = sheet_.lens_toward_panel,
                 .valley = sheet_.valley};
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

// Computes the result of an ideal calibration by tracing rays.

namespace {

struct Node {
  double place = 0.0;  // fraction of half the aperture
  double weight = 0.0;
};
/// Gauss-Legendre with eight nodes: exact for aberrations up to the 15th order of the height.
constexpr std::array<Node, 4> kHalfNodes{{{0.1834346424956498, 0.3626837833783620},
                                          {0.5255324099163290, 0.3137066458778873},
                                          {0.7966664774136267, 0.2223810344533745},
                                          {0.9602898564975363, 0.1012285362903763}}};

struct Landings {
  std::array<ApertureRay, 2 * kHalfNodes.size()> rays;
  size_t count = 0;
};

/// Returns the landing points of the rays from `eye` (coordinates of the lens), over the whole
/// lens.
Landings land_over_aperture(const LensStack& stack, Vec3 eye) {
  Landings landings;
  for (const Node& node : kHalfNodes) {
    for (const double side : {-1.0, 1.0}) {
      const double height = side * node.place * (1.0 - stack.valley) * stack.pitch_mm / 2.0;
      const std::optional<ApertureRay> ray = aperture_ray(stack, height, eye);
      if (ray) landings.rays[landings.count++] = {ray->landing, ray->weight * node.weight};
    }
  }
  return landings;
}

std::optional<Vec2> mean_landing(const Landings& landings) {
  Vec2 sum;
  double weights = 0.0;
  for (size_t i = 0; i < landings.count; ++i) {
    sum = sum + landings.rays[i].landing * landings.rays[i].weight;
    weights += landings.rays[i].weight;
  }
  if (weights == 0.0) return std::nullopt;
  return sum * (1.0 / weights);
}

/// Returns the landing point that the phase of fringes of one lens pitch indicates, near `mean`.
Vec2 fringe_landing(const Landings& landings, Vec2 mean, double pitch_mm) {
  const double wave = 2.0 * std::numbers::pi / pitch_mm;
  std::complex<double> sum;
  for (size_t i = 0; i < landings.count; ++i) {
    const ApertureRay& ray = landings.rays[i];
    sum += std::polar(ray.weight, wave * (ray.landing.x - mean.x));
  }
  return {mean.x + std::arg(sum) / wave, mean.y};
}

/// Returns the landing point, as a point of the panel, of a lens whose apex line passes through
/// `apex`.
std::optional<Vec2> mean_panel_point(const SheetShape& shape, Vec2 apex, int channel, Vec3 eye,
                                     LightMiddle middle) {
  const LocalLenses lenses = shape.lenses_at(apex, channel);
  const Stance stance = shape.stance_at(apex);
  const Vec3 from = stance.local(eye - stance.point);
  const Vec2 u = lenses.across();
  const Vec3 eye_of_lens{u.x * from.x + u.y * from.y, u.x * from.y - u.y * from.x, from.z};
  const Landings landings = land_over_aperture(lenses.stack, eye_of_lens);
  std::optional<Vec2> mean = mean_landing(landings);
  if (!mean) return std::nullopt;
  if (middle == LightMiddle::FringePhase) {
    mean = fringe_landing(landings, *mean, lenses.stack.pitch_mm);
  }
  return Vec2{apex.x + u.x * mean->x - u.y * mean->y, apex.y + u.y * mean->x + u.x * mean->y};
}

}  // namespace

/// Solves for the lens iteratively: a lens that lands beside the point is moved by the miss. Moving
/// a lens moves its landing by nearly the same amount (the difference is gap over distance), so a
/// few steps reach the last digit.
std::optional<TrueView> true_view(const SheetShape& shape, Vec2 panel_point_mm, int channel,
                                  Vec3 eye, LightMiddle middle) {
  Vec2 apex = panel_point_mm;
  for (int step = 0; step < 60; ++step) {
    const std::optional<Vec2> landing = mean_panel_point(shape, apex, channel, eye, middle);
    if (!landing) break;
    const Vec2 miss = panel_point_mm - *landing;
    apex = apex + miss;
    if (std::abs(miss.x) + std::abs(miss.y) < 1e-12) {
      const LocalLenses lenses = shape.lenses_at(apex, channel);
      const Stance stance = shape.stance_at(apex);
      const Vec2 aim = straight_aim(lenses.stack, stance.local(eye - stance.point));
      return TrueView{lenses.coordinate, stance.point + stance.tangent * aim.x + Vec3{0, aim.y, 0}};
    }
  }
  return std::nullopt;
}
}  // namespace lenticule::lab
