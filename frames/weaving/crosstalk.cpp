// SPDX-License-Identifier: Apache-2.0
#include "frames/weaving/crosstalk.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "base/error_kinds.h"
#include "frames/srgb.h"

namespace lenticule::frames {
namespace {

constexpr double kFull = 32767.0;
constexpr int kPointBits = 7;  ///< fraction of a code in the curve's points

double point_of(int light) {
  return std::ldexp(255.0 * srgb_from_linear(light / kFull), kPointBits);
}

void fill_part(std::array<int16_t, 64>& start, std::array<int16_t, 64>& rise, int step) {
  for (int n = 0; n < 64; ++n) {
    const double here = std::round(point_of(n * step));
    const double next = std::round(point_of((n + 1) * step));
    start[static_cast<size_t>(n)] = static_cast<int16_t>(here + (1 << (kPointBits - 1)));
    rise[static_cast<size_t>(n)] = static_cast<int16_t>(next - here);
  }
}

uint8_t encode(int light) {
  const EncodingCurve& curve = encoding_curve();
  const bool low = light < kLowLight;
  const auto n = static_cast<size_t>(low ? light >> 5 : light >> 9);
  const int part = (low ? light << 10 : light << 6) & 0x7fff;
  const int start = low ? curve.low_start[n] : curve.high_start[n];
  const int rise = low ? curve.low_rise[n] : curve.high_rise[n];
  return static_cast<uint8_t>((start + ((rise * part + 0x4000) >> 15)) >> kPointBits);
}

/// Parabola is one part of the light curve.
struct Parabola {
  int start = 0, rise = 0, bend = 0;

  [[nodiscard]] int at(int t) const {
    return start + ((t * (rise + ((t * bend + 4) >> 3)) + 4) >> 3);
  }
};

double exact_light(int code) { return kFull * linear_of_codes()[static_cast<size_t>(code)]; }

double furthest_off(const Parabola& parabola, int first_code) {
  double most = 0.0;
  for (int t = 0; t < 16; ++t)
    most = std::max(most, std::abs(parabola.at(t) - exact_light(first_code + t)));
  return most;
}

/// Returns the best parabola near the one through the first, a middle and the last code. The first
/// code of a part is as exact as possible: black stays black.
Parabola fitted(int first_code) {
  const double first = exact_light(first_code), last = exact_light(first_code + 15);
  const double middle = exact_light(first_code + 7);
  const double bend = ((last - first) / 15.0 - (middle - first) / 7.0) / (15.0 - 7.0);
  const int start = static_cast<int>(std::lround(first));
  const int about = static_cast<int>(std::lround(64.0 * bend));
  Parabola best;
  double least = kFull;
  for (int b = std::max(about - 8, 0); b <= about + 8; ++b) {
    const int rise = static_cast<int>(std::lround(8.0 * (last - first) / 15.0 - 15.0 * b / 8.0));
    for (int r = std::max(rise - 3, 0); r <= rise + 3; ++r) {
      const Parabola tried{start, r, b};
      const double off = furthest_off(tried, first_code);
      if (off >= least || tried.at(15) > kFull) continue;
      least = off;
      best = tried;
    }
  }
  return best;
}

constexpr double kMostPercent = 40.0;
constexpr double kSpotReach = 4.3;
constexpr double kSpotRestraint = 0.01;

/// Matrix is square, stored row by row.
class Matrix {
 public:
  explicit Matrix(int size) : size_(static_cast<size_t>(size)), values_(size_ * size_) {}
  [[nodiscard]] size_t size() const { return size_; }
  double& at(size_t row, size_t column) { return values_[row * size_ + column]; }
  [[nodiscard]] double at(size_t row, size_t column) const { return values_[row * size_ + column]; }
  [[nodiscard]] std::vector<double> values() && { return std::move(values_); }

 private:
  size_t size_;
  std::vector<double> values_;
};

Matrix shares_of(const Crosstalk& crosstalk, int views) {
  Matrix shares(views);
  for (size_t eye = 0; eye < shares.size(); ++eye) {
    double sum = 0.0;
    for (size_t view = 0; view < shares.size(); ++view) {
      const size_t apart = eye > view ? eye - view : view - eye;
      shares.at(eye, view) = apart < crosstalk.shares.size() ? crosstalk.shares[apart] : 0.0;
      sum += shares.at(eye, view);
    }
    for (size_t view = 0; view < shares.size(); ++view) shares.at(eye, view) /= sum;
  }
  return shares;
}

/// Returns W' B, plus e on the diagonal.
Matrix transposed_times(const Matrix& w, const Matrix& b, double restraint) {
  Matrix product(static_cast<int>(w.size()));
  for (size_t row = 0; row < w.size(); ++row) {
    for (size_t k = 0; k < w.size(); ++k)
      for (size_t column = 0; column < w.size(); ++column)
        product.at(row, column) += w.at(k, row) * b.at(k, column);
    product.at(row, row) += restraint;
  }
  return product;
}

Matrix identity(size_t size) {
  Matrix one(static_cast<int>(size));
  for (size_t n = 0; n < size; ++n) one.at(n, n) = 1.0;
  return one;
}

/// Solves A X = B by elimination; A is symmetric and positive definite, so no pivoting is needed.
Matrix solve(Matrix a, Matrix b) {
  const size_t size = a.size();
  for (size_t pivot = 0; pivot < size; ++pivot) {
    const double scale = 1.0 / a.at(pivot, pivot);
    for (size_t column = 0; column < size; ++column) {
      a.at(pivot, column) *= scale;
      b.at(pivot, column) *= scale;
    }
    for (size_t row = 0; row < size; ++row) {
      const double factor = a.at(row, pivot);
      if (row == pivot || factor == 0.0) continue;
      for (size_t column = 0; column < size; ++column) {
        a.at(row, column) -= factor * a.at(pivot, column);
        b.at(row, column) -= factor * b.at(pivot, column);
      }
    }
  }
  return b;
}

/// LightRows holds one row of pixels of all views, in linear light.
class LightRows {
 public:
  LightRows(const ViewSet& views, int row) : samples_(static_cast<size_t>(views.width()) * 3) {
    for (int view = 0; view < views.count(); ++view) {
      const uint8_t* codes = views.pixel(view, 0, row);
      for (size_t s = 0; s < samples_; ++s)
        light_.push_back(static_cast<float>(linear_of_codes()[codes[s]]));
    }
  }
  /// Computes one output view's light.
  void mix(const double* weights, size_t views, std::vector<float>& out) const {
    out.assign(samples_, 0.0F);
    for (size_t view = 0; view < views; ++view) {
      const auto weight = static_cast<float>(weights[view]);
      if (weight == 0.0F) continue;
      const float* const light = light_.data() + view * samples_;
      for (size_t s = 0; s < samples_; ++s) out[s] += weight * light[s];
    }
  }

 private:
  size_t samples_;
  std::vector<float> light_;
};

}  // namespace

const LightCurve& light_curve() {
  static const LightCurve curve = [] {
    LightCurve parts{};
    for (size_t n = 0; n < 16; ++n) {
      const Parabola part = fitted(static_cast<int>(16 * n));
      parts.start_low[n] = static_cast<uint8_t>(part.start & 0xff);
      parts.start_high[n] = static_cast<uint8_t>(part.start >> 8);
      parts.rise_low[n] = static_cast<uint8_t>(part.rise & 0xff);
      parts.rise_high[n] = static_cast<uint8_t>(part.rise >> 8);
      parts.bend[n] = static_cast<uint8_t>(part.bend);
    }
    return parts;
  }();
  return curve;
}

const std::array<uint16_t, 256>& light_of_codes15() {
  static const std::array<uint16_t, 256> table = [] {
    const LightCurve& curve = light_curve();
    std::array<uint16_t, 256> light{};
    for (size_t code = 0; code < light.size(); ++code) {
      const size_t n = code / 16;
      const Parabola part{.start = curve.start_low[n] | curve.start_high[n] << 8,
                          .rise = curve.rise_low[n] | curve.rise_high[n] << 8,
                          .bend = curve.bend[n]};
      light[code] = static_cast<uint16_t>(part.at(static_cast<int>(code % 16)));
    }
    return light;
  }();
  return table;
}

const EncodingCurve& encoding_curve() {
  static const EncodingCurve curve = [] {
    EncodingCurve points{};
    fill_part(points.low_start, points.low_rise, 32);
    fill_part(points.high_start, points.high_rise, 512);
    return points;
  }();
  return curve;
}

const std::array<uint8_t, 32768>& codes_of_light15() {
  static const auto table = [] {
    auto codes = std::make_unique<std::array<uint8_t, 32768>>();
    for (int light = 0; light < 32768; ++light)
      (*codes)[static_cast<size_t>(light)] = encode(light);
    return codes;
  }();
  return *table;
}

Crosstalk crosstalk_of_percent(double percent) {
  if (!(percent >= 0.0 && percent <= kMostPercent))
    throw usage_error("crosstalk {} %: not between 0 and 40", percent)
        .remedy("give the light that comes from the two neighbours of a view, for example 12");
  return {.shares = {1.0 - percent / 100.0, percent / 200.0}, .restraint = 0.0};
}

Crosstalk crosstalk_of_spot(double sigma_views) {
  Crosstalk crosstalk{.shares = {}, .restraint = kSpotRestraint};
  const double sigma = std::max(sigma_views, 1e-3);
  for (int apart = 0; apart <= kSpotReach * sigma; ++apart)
    crosstalk.shares.push_back(std::exp(-0.5 * apart * apart / (sigma * sigma)));
  return crosstalk;
}

std::vector<double> compensation_matrix(const Crosstalk& crosstalk, int views) {
  LENTICULE_CHECK(views > 0 && !crosstalk.shares.empty());
  const Matrix w = shares_of(crosstalk, views);
  return solve(transposed_times(w, w, crosstalk.restraint),
               transposed_times(w, identity(w.size()), crosstalk.restraint))
      .values();
}

ViewSet compensate(const ViewSet& views, const Crosstalk& crosstalk) {
  if (views.count() > kMostCompensatedViews)
    throw usage_error("crosstalk: {} views, the limit is {}", views.count(), kMostCompensatedViews);
  const auto count = static_cast<size_t>(views.count());
  const std::vector<double> matrix = compensation_matrix(crosstalk, views.count());
  std::vector<WovenFrame> pictures(count,
                                   WovenFrame({.width = views.width(), .height = views.height()}));
  std::vector<float> mixed;
  for (int row = 0; row < views.height(); ++row) {
    const LightRows light(views, row);
    for (size_t view = 0; view < count; ++view) {
      light.mix(matrix.data() + view * count, count, mixed);
      std::transform(mixed.begin(), mixed.end(), pictures[view].row(row),
                     [](float value) { return code_from_linear(value); });
    }
  }
  return ViewSet(std::move(pictures), views.aspect());
}

}  // namespace lenticule::frames
