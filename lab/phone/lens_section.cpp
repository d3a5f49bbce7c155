// SPDX-License-Identifier: Apache-2.0
#include "lab/phone/lens_section.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace lenticule::lab {

namespace {

/// Returns the index at red (610 nm), green (546 nm) or blue (460 nm), by Cauchy's formula A + B /
/// wavelength^2 with B from the Abbe number (n_d - 1) / (n_F - n_C), lines of 588, 486 and 656 nm.
double index_of(double green, double abbe, int channel) {
  constexpr std::array<double, 3> kMicrometres = {0.610, 0.546, 0.460};
  const double b = (green - 1.0) / abbe / (1.0 / (0.486 * 0.486) - 1.0 / (0.656 * 0.656));
  const double at = kMicrometres[static_cast<size_t>(channel)];
  return green + b * (1.0 / (at * at) - 1.0 / (0.546 * 0.546));
}

/// Refracts a unit direction at a surface with unit normal against it; Snell's law in vectors.
/// `ratio` is the index before divided by the index after.
Vec3 refracted(const Vec3& in, const Vec3& normal, double ratio) {
  const double cosine = -dot(in, normal);
  const double inside = std::sqrt(std::max(0.0, 1.0 - ratio * ratio * (1.0 - cosine * cosine)));
  return in * ratio + normal * (ratio * cosine - inside);
}

}  // namespace

LensSection::LensSection(const SheetBuild& build, const optics::Panel& panel)
    : build_(build), panel_(panel) {
  // Lens coordinates grow by 3 / P per pixel to the right and 3 m / P per pixel down.
  const double right = 3.0 / (build.pitch_subpx * panel.pixel_width.value);
  const double up = -3.0 * build.slant / (build.pitch_subpx * panel.pixel_height.value);
  const double size = std::hypot(right, up);
  across_ = {right / size, up / size};
  pitch_mm_ = 1.0 / size;
  for (int c = 0; c < 3; ++c)
    index_[static_cast<size_t>(c)] = index_of(build.sheet_index, build.abbe, c);
  // A single surface focuses at n R / (n - 1) in its medium.
  const double n = build.sheet_index;
  const double length = build.sheet_mm + build.glass_mm * n / build.glass_index;
  radius_mm_ = std::max(length / (1.0 + build.defocus) * (n - 1.0) / n, 0.55 * pitch_mm_);
}

std::optional<LensSection::Shift> LensSection::trace(double place, double tan_across,
                                                     double tan_along, int channel) const {
  const double p = pitch_mm_, r = radius_mm_;
  // A ray at depth h below the apices is at place p - tan_across h. It meets the arc of lens j
  // where (a - tan_across h)^2 + (r - h)^2 = r^2 with a = (place - j) p.
  double depth = std::numeric_limits<double>::infinity(), from_apex = 0.0;
  int lens = 0;
  for (int j = -1; j <= 1; ++j) {
    const double a = (place - j) * p;
    const double half = a * tan_across + r, square = 1.0 + tan_across * tan_across;
    const double root = half * half - square * a * a;
    if (root < 0.0) continue;
    const double h = (half - std::sqrt(root)) / square;
    const double at = a - tan_across * h;
    if (std::abs(at) > 0.5 * p || h >= depth) continue;
    depth = h;
    from_apex = at;
    lens = j;
  }
  if (!std::isfinite(depth) || std::abs(from_apex) > 0.5 * (1.0 - build_.valley) * p)
    return std::nullopt;
  const double n = index_[static_cast<size_t>(channel)];
  const Vec3 in = normalized(Vec3(-tan_across, -tan_along, -1.0));
  const Vec3 normal{from_apex / r, 0.0,
                    std::sqrt(std::max(0.0, 1.0 - from_apex * from_apex / (r * r)))};
  const Vec3 sheet = refracted(in, normal, 1.0 / n);
  const Vec3 glass = refracted(sheet, {0.0, 0.0, 1.0}, n / build_.glass_index);
  if (!(sheet.z < -1e-3) || !(glass.z < -1e-3)) return std::nullopt;
  const double down = build_.sheet_mm - depth;
  return Shift{
      -tan_across * depth + down * sheet.x / -sheet.z + build_.glass_mm * glass.x / -glass.z,
      -tan_along * depth + down * sheet.y / -sheet.z + build_.glass_mm * glass.y / -glass.z, lens};
}

double LensSection::lens_coordinate(Vec2 at) const {
  const double x = 2.0 * at.x / (panel_.width_px * panel_.pixel_width.value);
  const double y = 2.0 * at.y / (panel_.height_px * panel_.pixel_height.value);
  const auto& d = build_.deformation;
  const double bend = d[0] * x * x + d[1] * x * y + d[2] * y * y + d[3] * x * x * x +
                      d[4] * y * y * y +
                      d[5] * std::sin(2.0 * std::numbers::pi * x) * std::cos(std::numbers::pi * y);
  return (across_.x * at.x + across_.y * at.y) / pitch_mm_ + build_.offset_lenses + bend;
}

LensSection::Shift LensSection::mean_shift(double tan_across, double tan_along, int channel) const {
  // Equal parts of the plane of the apices send equal light to the eye. From the side, some rays of
  // one lens's width enter its neighbour; they count where they would be in the lens itself.
  constexpr int kSteps = 256;
  Shift sum;
  int count = 0;
  for (int k = 0; k < kSteps; ++k) {
    const double place = (k + 0.5) / kSteps - 0.5;
    const auto shift = trace(place, tan_across, tan_along, channel);
    if (!shift) continue;
    sum.across += (place - shift->lens) * pitch_mm_ + shift->across;
    sum.along += shift->along;
    ++count;
  }
  if (count == 0) return {};
  return {sum.across / count, sum.along / count};
}

double LensSection::ground_truth_phase(Vec2 q, int channel, const Vec3& eye) const {
  Vec2 lens = q;
  for (int step = 0; step < 40; ++step) {
    const double right = (eye.x - lens.x) / eye.z, up = (eye.y - lens.y) / eye.z;
    const Shift shift =
        mean_shift(across_.x * right + across_.y * up, along().x * right + along().y * up, channel);
    const Vec2 seen{lens.x + shift.across * across_.x + shift.along * along().x,
                    lens.y + shift.across * across_.y + shift.along * along().y};
    const Vec2 off = q - seen;
    lens = lens + off;
    if (std::hypot(off.x, off.y) < 1e-9) break;
  }
  return lens_coordinate(lens);
}

ShiftTable::ShiftTable(const LensSection& sheet) : sheet_(sheet) {
  values_.resize(size_t{3} * kSteps * kSteps);
}

void ShiftTable::evaluate(double tan_across, double tan_along, int channel, Table& out) {
  const double a = std::clamp(tan_across / kStep + kSteps / 2.0, 0.0, kSteps - 2.0);
  const double b = std::clamp(tan_along / kStep + kSteps / 2.0, 0.0, kSteps - 2.0);
  const int i = static_cast<int>(a), j = static_cast<int>(b);
  const auto fa = static_cast<float>(a - i), fb = static_cast<float>(b - j);
  const auto& v00 = table(i, j, channel);
  const auto& v10 = table(i + 1, j, channel);
  const auto& v01 = table(i, j + 1, channel);
  const auto& v11 = table(i + 1, j + 1, channel);
  const float w00 = (1 - fa) * (1 - fb), w10 = fa * (1 - fb), w01 = (1 - fa) * fb, w11 = fa * fb;
  for (size_t k = 0; k < kPlaces; ++k) {
    out[k].x = w00 * v00[k].x + w10 * v10[k].x + w01 * v01[k].x + w11 * v11[k].x;
    out[k].y = w00 * v00[k].y + w10 * v10[k].y + w01 * v01[k].y + w11 * v11[k].y;
  }
}

const ShiftTable::Table& ShiftTable::table(int i, int j, int channel) {
  std::optional<Table>& made =
      values_[(static_cast<size_t>(channel) * kSteps + static_cast<size_t>(j)) * kSteps +
              static_cast<size_t>(i)];
  if (!made) made = trace((i - kSteps / 2) * kStep, (j - kSteps / 2) * kStep, channel);
  return *made;
}

ShiftTable::Table ShiftTable::trace(double tan_across, double tan_along, int channel) const {
  Table out;
  const auto apex = sheet_.trace(0.0, tan_across, tan_along, channel);
  for (int k = 0; k < kPlaces; ++k) {
    const auto shift = sheet_.trace((k + 0.5) / kPlaces - 0.5, tan_across, tan_along, channel);
    Offset& o = out[static_cast<size_t>(k)];
    if (!shift || !apex) {
      o = {std::nanf(""), std::nanf("")};
      continue;
    }
    const double across = shift->across - apex->across, along = shift->along - apex->along;
    const optics::Panel& panel = sheet_.panel();
    o.x = static_cast<float>((across * sheet_.across().x + along * sheet_.along().x) /
                             panel.pixel_width.value);
    o.y = static_cast<float>(-(across * sheet_.across().y + along * sheet_.along().y) /
                             panel.pixel_height.value);
  }
  return out;
}
}  // namespace lenticule::lab
