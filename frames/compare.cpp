// SPDX-License-Identifier: Apache-2.0
#include "frames/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "base/error_kinds.h"
#include "frames/quilt.h"
#include "frames/weave.h"
#include "optics/row_rays.h"

namespace lenticule::frames {
namespace {

constexpr double kPeak = 255.0;

std::string size_text(const FrameGeometry& geometry) {
  return fmt::format("{} x {}", geometry.width, geometry.height);
}

/// Returns the colour for 0 to 255 levels on a logarithmic scale.
std::array<uint8_t, 3> heat_of(int levels) {
  struct Stop {
    double place;
    std::array<double, 3> colour;
  };
  static constexpr std::array<Stop, 6> kStops = {{{0.0, {0, 0, 0}},
                                                  {0.2, {0, 0, 200}},
                                                  {0.4, {0, 170, 110}},
                                                  {0.6, {240, 220, 0}},
                                                  {0.8, {230, 30, 0}},
                                                  {1.0, {255, 255, 255}}}};
  const double place = std::log2(1.0 + levels) / 8.0;
  size_t above = 1;
  while (above + 1 < kStops.size() && kStops[above].place < place) ++above;
  const Stop& low = kStops[above - 1];
  const Stop& high = kStops[above];
  const double share = (place - low.place) / (high.place - low.place);
  std::array<uint8_t, 3> colour{};
  for (size_t c = 0; c < colour.size(); ++c)
    colour[c] = static_cast<uint8_t>(std::lround(std::lerp(low.colour[c], high.colour[c], share)));
  return colour;
}

using Window = std::array<double, kSimilarityWindow>;

/// Returns the weights of one direction; the window is their product with themselves.
Window gaussian() {
  constexpr double kSigma = 1.5;
  Window weights{};
  double sum = 0.0;
  for (size_t k = 0; k < weights.size(); ++k) {
    const double distance = static_cast<double>(k) - kSimilarityWindow / 2;
    weights[k] = std::exp(-0.5 * distance * distance / (kSigma * kSigma));
    sum += weights[k];
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

struct Plane {
  int width = 0;
  int height = 0;
  std::vector<double> values;

  [[nodiscard]] const double* row(int j) const {
    return values.data() + static_cast<size_t>(j) * static_cast<size_t>(width);
  }
};

Plane luma(const FrameView& picture) {
  const auto& geometry = picture.geometry;
  Plane plane{geometry.width, geometry.height, {}};
  plane.values.reserve(picture.bytes.size() / 3);
  for (size_t b = 0; b + 2 < picture.bytes.size(); b += 3)
    plane.values.push_back(0.299 * picture.bytes[b] + 0.587 * picture.bytes[b + 1] +
                           0.114 * picture.bytes[b + 2]);
  return plane;
}

Plane product(const Plane& a, const Plane& b) {
  Plane plane = a;
  for (size_t i = 0; i < plane.values.size(); ++i) plane.values[i] *= b.values[i];
  return plane;
}

/// Returns weighted means over every window inside the plane: ten columns and rows fewer.
Plane blurred(const Plane& plane, const Window& weights) {
  constexpr int kLess = kSimilarityWindow - 1;
  Plane across{plane.width - kLess, plane.height, {}};
  across.values.reserve(static_cast<size_t>(across.width) * static_cast<size_t>(across.height));
  for (int j = 0; j < across.height; ++j)
    for (int i = 0; i < across.width; ++i) {
      double sum = 0.0;
      for (size_t k = 0; k < weights.size(); ++k)
        sum += weights[k] * plane.row(j)[i + static_cast<int>(k)];
      across.values.push_back(sum);
    }
  Plane both{across.width, plane.height - kLess, {}};
  both.values.reserve(static_cast<size_t>(both.width) * static_cast<size_t>(both.height));
  for (int j = 0; j < both.height; ++j)
    for (int i = 0; i < both.width; ++i) {
      double sum = 0.0;
      for (size_t k = 0; k < weights.size(); ++k)
        sum += weights[k] * across.row(j + static_cast<int>(k))[i];
      both.values.push_back(sum);
    }
  return both;
}

}  // namespace

void require_same_size(const FrameView& reference, const FrameView& test) {
  if (reference.geometry != test.geometry)
    throw input_error("test picture: {} pixels, but the reference has {}", size_text(test.geometry),
                      size_text(reference.geometry))
        .remedy("compare pictures of one size");
}

void Difference::add(const Difference& other) {
  for (size_t d = 0; d < histogram_.size(); ++d) histogram_[d] += other.histogram_[d];
}

double Difference::mse() const {
  // Exact in integers: at most 2^30 samples times 2^16.
  uint64_t squares = 0;
  for (size_t d = 0; d < histogram_.size(); ++d) squares += histogram_[d] * d * d;
  const uint64_t n = samples();
  return n == 0 ? 0.0 : static_cast<double>(squares) / static_cast<double>(n);
}

double Difference::rmse() const { return std::sqrt(mse()); }

std::optional<double> Difference::psnr_db() const {
  const double error = mse();
  if (error == 0.0) return std::nullopt;
  return 10.0 * std::log10(kPeak * kPeak / error);
}

int Difference::max() const {
  for (size_t d = histogram_.size(); d-- > 0;)
    if (histogram_[d] > 0) return static_cast<int>(d);
  return 0;
}

uint64_t Difference::count_over(int levels) const {
  uint64_t count = 0;
  for (size_t d = static_cast<size_t>(levels + 1); d < histogram_.size(); ++d)
    count += histogram_[d];
  return count;
}

double Difference::share_over(int levels) const {
  const uint64_t n = samples();
  return n == 0 ? 0.0 : static_cast<double>(count_over(levels)) / static_cast<double>(n);
}

PictureDifference compare_pictures(const FrameView& reference, const FrameView& test) {
  require_same_size(reference, test);
  PictureDifference difference;
  for (size_t b = 0; b < reference.bytes.size(); ++b)
    difference.channels[b % 3].add(reference.bytes[b], test.bytes[b]);
  for (const Difference& channel : difference.channels) difference.total.add(channel);
  return difference;
}

WovenFrame error_picture(const FrameView& reference, const FrameView& test) {
  require_same_size(reference, test);
  WovenFrame picture(reference.geometry);
  for (size_t b = 0; b + 2 < reference.bytes.size(); b += 3) {
    int largest = 0;
    for (size_t c = 0; c < 3; ++c)
      largest = std::max(largest, std::abs(int{reference.bytes[b + c]} - int{test.bytes[b + c]}));
    const auto colour = heat_of(largest);
    std::copy(colour.begin(), colour.end(), picture.bytes().begin() + static_cast<ptrdiff_t>(b));
  }
  return picture;
}

int native_view_count(const optics::Rig& rig) {
  return std::max(1, static_cast<int>(std::lround(rig.sheet.pitch.value)));
}

std::vector<Difference> compare_views(const FrameView& reference, const FrameView& test,
                                      const optics::OpticalModel& model, int views) {
  require_same_size(reference, test);
  const optics::Panel& panel = model.rig().panel;
  const FrameGeometry& geometry = reference.geometry;
  if (geometry.width != panel.width_px || geometry.height != panel.height_px)
    throw input_error("pictures of {} pixels: the rig's panel has {} x {}", size_text(geometry),
                      panel.width_px, panel.height_px);
  if (views < 1 || views > kMaxViews)
    throw usage_error("{} views: not in 1 ... {}", views, kMaxViews);

  std::vector<Difference> differences(static_cast<size_t>(views));
  const optics::RowRayEvaluator evaluator(model);
  optics::RowRays rays;
  for (int j = 0; j < geometry.height; ++j) {
    evaluator.evaluate(j, 0, geometry.width, rays);
    const uint8_t* const a = reference.row(j);
    const uint8_t* const b = test.row(j);
    for (size_t s = 0; s < rays.size(); ++s) {
      const int view = nearest_view(optics::view_number(rays.place[s], views), views);
      differences[static_cast<size_t>(view)].add(a[s], b[s]);
    }
  }
  return differences;
}

int worst_view(const std::vector<Difference>& views) {
  const auto less = [](const Difference& a, const Difference& b) { return a.mse() < b.mse(); };
  return static_cast<int>(std::max_element(views.begin(), views.end(), less) - views.begin());
}

std::optional<double> structural_similarity(const FrameView& reference, const FrameView& test) {
  require_same_size(reference, test);
  if (reference.geometry.width < kSimilarityWindow || reference.geometry.height < kSimilarityWindow)
    return std::nullopt;
  static const Window weights = gaussian();
  const Plane a = luma(reference);
  const Plane b = luma(test);
  const Plane mean_a = blurred(a, weights);
  const Plane mean_b = blurred(b, weights);
  const Plane square_a = blurred(product(a, a), weights);
  const Plane square_b = blurred(product(b, b), weights);
  const Plane mixed = blurred(product(a, b), weights);

  constexpr double kC1 = (0.01 * 255.0) * (0.01 * 255.0);
  constexpr double kC2 = (0.03 * 255.0) * (0.03 * 255.0);
  double sum = 0.0;
  for (size_t i = 0; i < mean_a.values.size(); ++i) {
    const double ma = mean_a.values[i];
    const double mb = mean_b.values[i];
    const double variances = square_a.values[i] - ma * ma + square_b.values[i] - mb * mb;
    const double covariance = mixed.values[i] - ma * mb;
    sum += (2.0 * ma * mb + kC1) * (2.0 * covariance + kC2) /
           ((ma * ma + mb * mb + kC1) * (variances + kC2));
  }
  return sum / static_cast<double>(mean_a.values.size());
}

}  // namespace lenticule::frames
