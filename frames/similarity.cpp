// SPDX-License-Identifier: Apache-2.0
#include "frames/similarity.h"

#include <array>
#include <cmath>
#include <vector>

#include "frames/compare.h"

namespace lenticule::frames {
namespace {

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
