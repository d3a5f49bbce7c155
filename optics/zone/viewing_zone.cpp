// SPDX-License-Identifier: Apache-2.0
// An eye sees a subpixel if the subpixel's phase lies near a whole number. Over a zone the phase is
// an interval between the phases of four eyes: along z at a fixed place, and along x at a fixed
// distance, it changes in one direction only. So a subpixel is unseen if no whole number lies in
// its interval, widened by the largest distance at which an eye still sees a subpixel.
#include "optics/zone/viewing_zone.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/numbers.h"

namespace lenticule::optics {
namespace {

constexpr double kMostSidewaysMm = 1e5;
constexpr double kMostDistanceMm = 1e6;
/// A reach at which every subpixel is seen.
constexpr double kEverything = 1.0;

/// Returns "LOW:HIGH", or -N to N for a single number if `symmetric`.
std::optional<Interval> range_from(std::string_view text, bool symmetric) {
  if (const auto half = number_from<double>(text); half && symmetric)
    return Interval{0.0 - *half, *half};
  const auto ends = numbers_from<double, 2>(text, ':');
  return ends ? std::optional(Interval{(*ends)[0], (*ends)[1]}) : std::nullopt;
}

bool lies_in(const Interval& range, double low, double high) {
  return range.low >= low && range.low <= range.high && range.high <= high;
}

Interval distances(const ViewingZone& zone, const OpticalModel& model) {
  if (zone.z_mm) return *zone.z_mm;
  const double z = model.rig().viewing.distance.value;
  if (std::isinf(z))
    throw Error(ErrorKind::Input, "--zone: the viewing distance of this rig is infinite",
                "state the distances of the eyes, too, for example --zone 60@650:750");
  return {z * (1.0 - kZoneDepth), z * (1.0 + kZoneDepth)};
}

/// Returns the largest distances, along x and y, from a point of the panel to an eye of the zone.
Vec2 farthest_mm(const Rig& rig, const ViewingZone& zone) {
  const Panel& panel = rig.panel;
  return {0.5 * panel.width_px * panel.pixel_width.value + std::abs(rig.viewing.centre.value) +
              zone.x_mm.largest(),
          0.5 * panel.height_px * panel.pixel_height.value + std::abs(rig.viewing.height.value)};
}

/// Returns the slant as a tangent on the panel, to either side.
double slope_of(const Rig& rig) {
  return std::abs(rig.sheet.slant) * rig.panel.pixel_width.value / rig.panel.pixel_height.value;
}

double kappa_of(const Rig& rig) {
  return std::abs(1.0 - rig.sheet.refraction_shape);
}

/// Returns true if the phase changes in one direction only along the sides of the zone. At grazing
/// directions, where an eye that moves sideways changes the vertical shift, it may turn.
bool is_monotone(const Rig& rig, Vec2 farthest, double near_mm) {
  return slope_of(rig) * kappa_of(rig) * farthest.x * farthest.y < 0.5 * near_mm * near_mm;
}

/// Returns the largest slopes of the residual map in lenses per pixel. Between knots, the spline is
/// at most 2.5 times as steep as from knot to knot.
Vec2 residual_slopes(const Rig& rig) {
  const ResidualMap& map = rig.sheet.residual;
  Vec2 most{0.0, 0.0};
  for (int r = 0; r < map.rows; ++r)
    for (int c = 0; c < map.columns; ++c) {
      const double* here = map.lenses.data() + r * map.columns + c;
      if (c > 0) most.x = std::max(most.x, std::abs(here[0] - here[-1]));
      if (r > 0) most.y = std::max(most.y, std::abs(here[0] - here[-map.columns]));
    }
  return {2.5 * most.x * (map.columns - 1) / rig.panel.width_px,
          2.5 * most.y * (map.rows - 1) / rig.panel.height_px};
}

/// Returns by how much the residual map at a lens point may change from one eye of the zone to
/// another, in lenses.
double residual_change(const Rig& rig, const ViewingZone& zone, Vec2 farthest, const Interval& z) {
  const double bend = std::sqrt(kappa_of(rig));
  const double inverse =
      1.0 / z.low - 1.0 / std::hypot(z.high, bend * farthest.x, bend * farthest.y);
  const double gap = rig.sheet.gap.value;
  const Vec2 shift_mm{gap * (zone.x_mm.width() / z.low + farthest.x * inverse),
                      gap * farthest.y * inverse};
  const Vec2 slopes = residual_slopes(rig);
  return slopes.x * shift_mm.x / rig.panel.pixel_width.value +
         slopes.y * shift_mm.y / rig.panel.pixel_height.value;
}

/// Returns the distance in phase of neighbouring pixels of a row for eyes from `near_mm` on.
Interval pixel_in_lenses(const Rig& rig, double near_mm) {
  const double lenses_per_px = 3.0 / rig.sheet.pitch.value;
  const double stretch = residual_slopes(rig).x / lenses_per_px;
  const double bend = rig.sheet.gap.value / near_mm * (1.0 + slope_of(rig));
  return {lenses_per_px * (1.0 - stretch) * (1.0 - bend),
          lenses_per_px * (1.0 + stretch) * (1.0 + bend * slope_of(rig))};
}

/// Returns the largest difference of places along a row, in pixels, that a layout makes between two
/// subpixels of one channel in a row.
double layout_spread_px(const Rig& rig) {
  const SubpixelLayout& layout = rig.panel.layout;
  double most = 0.0;
  for (int row = 0; row < layout.rows(); ++row)
    for (int channel = 0; channel < 3; ++channel) {
      Interval places;
      for (int column = 0; column < layout.columns(); ++column) {
        const SubpixelOffset& offset = layout.offset(column, row, channel);
        places.extend(offset.x_px + rig.sheet.slant * offset.y_px);
      }
      most = std::max(most, places.width());
    }
  return most;
}

/// Sight describes how far an eye sees subpixels beside a lens.
struct Sight {
  double lenses;  ///< distance in phase at which a subpixel is just not seen
  int pixels;     ///< distance to the subpixel that is seen instead
};

/// Returns how far from a lens a subpixel is seen. simulate_eye() ignores a subpixel at distance d
/// if another one of its channel and row, at distance n, has more than e^16 times its weight: d^2 -
/// n^2 > 32 sigma^2. With n = d - u for the subpixel u lenses nearer, that is d > u / 2 + 16
/// sigma^2 / u, and the best u counts. `pixel` is the distance of neighbouring pixels in lenses.
Sight sight_of(const Rig& rig, const Interval& pixel) {
  const double sigma = std::min(rig.sheet.spot_sigma.value, 1.0);
  const double variances = 16.0 * sigma * sigma;
  const double spread = layout_spread_px(rig);
  const auto limit = [&](double u) { return 0.5 * u + variances / u; };
  Sight sight{kEverything, 0};
  for (int k = 1; k < rig.panel.width_px; ++k) {
    const Interval u{(k - spread) * pixel.low, (k + spread) * pixel.high};
    if (u.low <= 0.0) continue;
    const double d = std::max(limit(u.low), limit(u.high));
    if (d < sight.lenses) sight = {d, k};
    if (u.low > kEverything) break;
  }
  return sight;
}

/// Returns the largest error of a phase that is interpolated linearly over `step_px` pixels.
double interpolation_error(const Rig& rig, int step_px, double near_mm) {
  if (step_px == 1) return 0.0;
  const double pixel = rig.panel.pixel_width.value;
  // The second derivative of u / sqrt(1 + kappa u^2) is below sqrt(kappa), and that of the spline
  // below 15 times the step from knot to knot.
  const double bend = 2.0 * std::sqrt(kappa_of(rig)) * (1.0 + slope_of(rig)) * 3.0 /
                      rig.sheet.pitch.value * rig.sheet.gap.value * pixel / (near_mm * near_mm);
  const double residual =
      8.0 * residual_slopes(rig).x * rig.sheet.residual.columns / rig.panel.width_px;
  return 0.125 * step_px * step_px * (bend + residual);
}

/// Returns the largest step with an error that hardly matters.
int interpolation_step(const Rig& rig, double near_mm) {
  constexpr double kSmall = 1e-3;
  // The subpixels of irregular layouts do not lie at equal distances.
  int step_px = rig.panel.layout.columns() > 1 ? 1 : 32;
  while (interpolation_error(rig, step_px, near_mm) > kSmall) step_px /= 2;
  return step_px;
}

/// Marks those of `count` subpixels, one in each pixel, of which no phase from `first`, that of the
/// first one, to `next`, that of the one after the last, is a whole number. The smallest phases in
/// between lie above a straight line, and the largest ones below.
void mark_unseen(const Interval& first, const Interval& next, int count, uint8_t* seen) {
  if (first.width() >= 1.0 && next.width() >= 1.0) return;
  const double low_step = (next.low - first.low) / count;
  const double high_step = (next.high - first.high) / count;
  for (int n = 0; n < count; ++n)
    if (std::floor(first.high + n * high_step) < first.low + n * low_step) seen[3 * n] = 0;
}

}  // namespace

ViewingZone parse_viewing_zone(std::string_view text) {
  const size_t at = text.find('@');
  const auto x = range_from(text.substr(0, at), true);
  const bool has_depth = at != std::string_view::npos;
  const auto z = has_depth ? range_from(text.substr(at + 1), false) : std::nullopt;
  if (!x || (has_depth && !z))
    throw Error(
        ErrorKind::Usage, fmt::format("--zone '{}': not a viewing zone in mm", text),
        "for example --zone 60, --zone -20:80 (LEFT:RIGHT) or --zone 60@650:750 (@NEAR:FAR)");
  if (!lies_in(*x, -kMostSidewaysMm, kMostSidewaysMm))
    throw Error(ErrorKind::Usage,
                fmt::format("--zone '{}': left is not to the left of right, within {} mm", text,
                            kMostSidewaysMm),
                "for example --zone -20:80, from 20 mm to the left to 80 mm to the right");
  if (z && (!(z->low > 0.0) || !lies_in(*z, 0.0, kMostDistanceMm)))
    throw Error(ErrorKind::Usage,
                fmt::format("--zone '{}': distances are not from near to far, above 0 and up to {} "
                            "mm",
                            text, kMostDistanceMm),
                "for example --zone 60@650:750, from 650 to 750 mm in front of the panel");
  return {*x, z};
}

std::string to_text(const ViewingZone& zone) {
  const std::string sides = fmt::format("{}:{}", zone.x_mm.low, zone.x_mm.high);
  return zone.z_mm ? fmt::format("{}@{}:{}", sides, zone.z_mm->low, zone.z_mm->high) : sides;
}

ZoneVisibility::ZoneVisibility(const OpticalModel& model, const ViewingZone& zone)
    : width_px_(model.rig().panel.width_px) {
  const Rig& rig = model.rig();
  const Interval z = distances(zone, model);
  for (const double x : {zone.x_mm.low, zone.x_mm.high})
    for (const double z_mm : {z.low, z.high})
      corners_.emplace_back(model,
                            Eye{rig.viewing.centre.value + x, rig.viewing.height.value, z_mm});
  const Vec2 farthest = farthest_mm(rig, zone);
  const Sight sight = sight_of(rig, pixel_in_lenses(rig, z.low));
  constexpr double kRounding = 1e-6;
  edge_px_ = sight.pixels + 1;
  step_px_ = interpolation_step(rig, z.low);
  reach_ = is_monotone(rig, farthest, z.low)
               ? sight.lenses + residual_change(rig, zone, farthest, z) +
                     interpolation_error(rig, step_px_, z.low) + kRounding
               : kEverything;
}

/// Sets the intervals of phases of every step_px_-th pixel and of the last one.
void ZoneVisibility::evaluate_some(int j, Row& out) const {
  const int last = width_px_ - 1;
  const int count = 1 + (last + step_px_ - 1) / step_px_;
  out.phases.assign(3 * static_cast<size_t>(count), {});
  for (const RowPhaseEvaluator& corner : corners_) {
    Interval* to = out.phases.data();
    for (int n = 0; n < count; ++n) {
      const int i = std::min(n * step_px_, last);
      corner.evaluate(j, i, i + 1, out.phase);
      for (const double phase : out.phase) (to++)->extend(phase);
    }
  }
}

void ZoneVisibility::evaluate(int j, Row& out) const {
  const int last = width_px_ - 1;
  out.seen.assign(3 * static_cast<size_t>(width_px_), 1);
  if (reach_ >= kEverything || 2 * edge_px_ >= width_px_) return;
  evaluate_some(j, out);
  const Interval* phases = out.phases.data();
  for (int i = 0; i < last; i += step_px_, phases += 3)
    for (int channel = 0; channel < 3; ++channel)
      mark_unseen(phases[channel].widened(reach_), phases[3 + channel].widened(reach_),
                  std::min(step_px_, last - i), out.seen.data() + 3 * i + channel);
  const auto edge = static_cast<ptrdiff_t>(3 * edge_px_);
  std::fill_n(out.seen.begin(), edge, uint8_t{1});
  std::fill_n(out.seen.rbegin(), edge, uint8_t{1});
}

}  // namespace lenticule::optics
