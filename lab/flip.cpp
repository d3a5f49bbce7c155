// SPDX-License-Identifier: Apache-2.0
#include "lab/flip.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "base/statistics.h"
#include "frames/compare.h"
#include "frames/srgb.h"

namespace lenticule::lab {
namespace {

/// Taps are the weights of a filter, odd in number; the middle one belongs to the pixel itself.
using Taps = std::vector<double>;

struct Plane {
  int width = 0;
  int height = 0;
  std::vector<float> values;

  Plane(int w, int h) : width(w), height(h), values(static_cast<size_t>(w) * size_t(h)) {}
  [[nodiscard]] float* row(int j) {
    return values.data() + static_cast<size_t>(j) * static_cast<size_t>(width);
  }
  [[nodiscard]] const float* row(int j) const {
    return values.data() + static_cast<size_t>(j) * static_cast<size_t>(width);
  }
};

// ---- filters: each is a product of a horizontal and a vertical one

void add_row(const float* from, float weight, int count, float* to) {
  for (int i = 0; i < count; ++i) to[i] += weight * from[i];
}

Plane filtered_across(const Plane& plane, const Taps& taps) {
  const int radius = static_cast<int>(taps.size()) / 2;
  Plane result(plane.width, plane.height);
  std::vector<float> padded(static_cast<size_t>(plane.width + 2 * radius));
  for (int j = 0; j < plane.height; ++j) {
    const float* const row = plane.row(j);
    std::fill_n(padded.begin(), radius, row[0]);
    std::copy_n(row, plane.width, padded.begin() + radius);
    std::fill_n(padded.begin() + radius + plane.width, radius, row[plane.width - 1]);
    for (size_t k = 0; k < taps.size(); ++k)
      add_row(padded.data() + k, static_cast<float>(taps[k]), plane.width, result.row(j));
  }
  return result;
}

Plane filtered_down(const Plane& plane, const Taps& taps) {
  const int radius = static_cast<int>(taps.size()) / 2;
  Plane result(plane.width, plane.height);
  for (int j = 0; j < plane.height; ++j)
    for (int k = -radius; k <= radius; ++k)
      add_row(plane.row(std::clamp(j + k, 0, plane.height - 1)),
              static_cast<float>(taps[static_cast<size_t>(k + radius)]), plane.width,
              result.row(j));
  return result;
}

Plane filtered(const Plane& plane, const Taps& across, const Taps& down) {
  return filtered_down(filtered_across(plane, across), down);
}

double sum_of(const Taps& taps) {
  double sum = 0.0;
  for (const double tap : taps) sum += tap;
  return sum;
}

// ---- blur of the eye

/// Sensitivity is one term of a contrast sensitivity: a sqrt(pi / b) exp(-pi^2 d^2 / b), d in
/// degrees.
struct Sensitivity {
  double a;
  double b;
};
constexpr Sensitivity kAchromatic{1.0, 0.0047};
constexpr Sensitivity kRedGreen{1.0, 0.0053};
constexpr std::array<Sensitivity, 2> kBlueYellow{{{34.1, 0.04}, {13.5, 0.025}}};

/// Returns three standard deviations of the widest filter, used for all filters.
int blur_radius(double pixels_per_degree) {
  const double sigma = std::sqrt(kBlueYellow[0].b / 2.0) / std::numbers::pi;
  return static_cast<int>(std::ceil(3.0 * sigma * pixels_per_degree));
}

Taps blur_taps(const Sensitivity& term, double pixels_per_degree) {
  const int radius = blur_radius(pixels_per_degree);
  Taps taps;
  for (int k = -radius; k <= radius; ++k) {
    const double angle = std::numbers::pi * k / pixels_per_degree;
    taps.push_back(std::exp(-angle * angle / term.b));
  }
  return taps;
}

Taps normalised(Taps taps) {
  const double sum = sum_of(taps);
  for (double& tap : taps) tap /= sum;
  return taps;
}

Plane blurred(const Plane& plane, const Sensitivity& term, double pixels_per_degree) {
  const Taps taps = normalised(blur_taps(term, pixels_per_degree));
  return filtered(plane, taps, taps);
}

/// Blurs with a sum of two products, each scaled by its fraction of the total weight.
Plane blurred_blue_yellow(const Plane& plane, double pixels_per_degree) {
  std::array<double, 2> weight{};
  for (size_t t = 0; t < weight.size(); ++t) {
    const double side = sum_of(blur_taps(kBlueYellow[t], pixels_per_degree));
    weight[t] = kBlueYellow[t].a * std::sqrt(std::numbers::pi / kBlueYellow[t].b) * side * side;
  }
  Plane result = blurred(plane, kBlueYellow[0], pixels_per_degree);
  const Plane narrow = blurred(plane, kBlueYellow[1], pixels_per_degree);
  const auto share = static_cast<float>(weight[1] / (weight[0] + weight[1]));
  for (size_t i = 0; i < result.values.size(); ++i)
    result.values[i] += share * (narrow.values[i] - result.values[i]);
  return result;
}

// ---- colours

/// Tristimulus is CIE XYZ of linear sRGB, relative to white.
struct Tristimulus {
  double x, y, z;
};

constexpr double kWhiteX = 23359437.0 / 24577794.0;
constexpr double kWhiteZ = 80288307.0 / 73733382.0;

Tristimulus tristimulus(double r, double g, double b) {
  return {.x = (10135552.0 * r + 8788810.0 * g + 4435075.0 * b) / 23359437.0,
          .y = (2613072.0 * r + 8788810.0 * g + 887015.0 * b) / 12288897.0,
          .z = (1425312.0 * r + 8788810.0 * g + 70074185.0 * b) / 80288307.0};
}

/// Clips to the colours of a display: components below 0 and above 1 are cut off.
Tristimulus shown(const Tristimulus& t) {
  const double x = t.x * kWhiteX;
  const double z = t.z * kWhiteZ;
  const auto held = [](double part) { return std::clamp(part, 0.0, 1.0); };
  return tristimulus(held(3.241003275 * x - 1.537398934 * t.y - 0.498615861 * z),
                     held(-0.969224334 * x + 1.875930071 * t.y + 0.041554224 * z),
                     held(0.055639423 * x - 0.204011202 * t.y + 1.057148933 * z));
}

float lightness_curve(double part) {
  constexpr double kDelta = 6.0 / 29.0;
  // Single precision: most of the time goes into cube roots.
  if (part > kDelta * kDelta * kDelta) return std::cbrt(static_cast<float>(part));
  return static_cast<float>(part / (3.0 * kDelta * kDelta) + 4.0 / 29.0);
}

/// Returns L*a*b* with chroma that grows with lightness (Hunt effect).
std::array<float, 3> adjusted_lab(const Tristimulus& t) {
  const float x = lightness_curve(t.x);
  const float y = lightness_curve(t.y);
  const float z = lightness_curve(t.z);
  const float lightness = 116.0F * y - 16.0F;
  return {lightness, 0.01F * lightness * 500.0F * (x - y), 0.01F * lightness * 200.0F * (y - z)};
}

/// Returns the HyAB distance: city block in lightness, Euclidean in chroma.
float colour_distance(const std::array<float, 3>& p, const std::array<float, 3>& q) {
  const float a = p[1] - q[1];
  const float b = p[2] - q[2];
  return std::abs(p[0] - q[0]) + std::sqrt(a * a + b * b);
}

constexpr float kColourExponent = 0.7F;

/// Maps distances raised to kColourExponent to 0 to 1: most of the range is used for the smaller
/// distances.
float colour_error(float distance) {
  constexpr float kSmall = 0.4F;
  constexpr float kOfSmall = 0.95F;
  static const float largest = std::pow(
      colour_distance(adjusted_lab(tristimulus(0, 1, 0)), adjusted_lab(tristimulus(0, 0, 1))),
      kColourExponent);
  const float raised = std::pow(distance, kColourExponent);
  const float border = kSmall * largest;
  if (raised < border) return kOfSmall * raised / border;
  return kOfSmall + (raised - border) / (largest - border) * (1.0F - kOfSmall);
}

// ---- edges and points

/// Scales the derivative's positive weights to sum to 1, its negative ones to -1.
Taps balanced(Taps taps) {
  double above = 0.0;
  double below = 0.0;
  for (const double tap : taps) (tap > 0.0 ? above : below) += std::abs(tap);
  for (double& tap : taps) tap /= tap > 0.0 ? above : below;
  return taps;
}

struct FeatureTaps {
  Taps smooth, edge, point;
};

FeatureTaps feature_taps(double pixels_per_degree) {
  constexpr double kWidthDegrees = 0.082;
  const double sigma = 0.5 * kWidthDegrees * pixels_per_degree;
  const int radius = static_cast<int>(std::ceil(3.0 * sigma));
  FeatureTaps taps;
  for (int k = -radius; k <= radius; ++k) {
    const double weight = std::exp(-0.5 * k * k / (sigma * sigma));
    taps.smooth.push_back(weight);
    taps.edge.push_back(-k * weight);
    taps.point.push_back((k * k / (sigma * sigma) - 1.0) * weight);
  }
  return {normalised(taps.smooth), balanced(taps.edge), balanced(taps.point)};
}

/// Returns the strength of the feature in any direction.
std::vector<float> features(const Plane& grey, const Taps& derivative, const Taps& smooth) {
  const Plane across = filtered(grey, derivative, smooth);
  Plane down = filtered(grey, smooth, derivative);
  for (size_t i = 0; i < down.values.size(); ++i) {
    const float a = across.values[i];
    const float d = down.values[i];
    down.values[i] = std::sqrt(a * a + d * d);
  }
  return std::move(down.values);
}

/// Opponents holds grey and the two opponent colours, each linear in light.
struct Opponents {
  Plane grey, red_green, blue_yellow;
};

Opponents opponents_of(const frames::FrameView& picture) {
  const auto& light = frames::linear_of_codes();
  const int width = picture.geometry.width;
  const int height = picture.geometry.height;
  Opponents planes{Plane(width, height), Plane(width, height), Plane(width, height)};
  for (size_t i = 0; i < planes.grey.values.size(); ++i) {
    const uint8_t* const codes = picture.bytes.data() + 3 * i;
    const Tristimulus t = tristimulus(light[codes[0]], light[codes[1]], light[codes[2]]);
    planes.grey.values[i] = static_cast<float>(t.y);
    planes.red_green.values[i] = static_cast<float>(t.x - t.y);
    planes.blue_yellow.values[i] = static_cast<float>(t.y - t.z);
  }
  return planes;
}

}  // namespace

FlipPicture::FlipPicture(const frames::FrameView& picture, double pixels_per_degree)
    : geometry_(picture.geometry), pixels_per_degree_(pixels_per_degree) {
  if (!(pixels_per_degree >= 1.0 && pixels_per_degree <= 1000.0))
    throw Error(ErrorKind::Usage,
                fmt::format("{} pixels per degree: not in 1 ... 1000", pixels_per_degree));
  if (picture.bytes.empty()) return;
  Opponents planes = opponents_of(picture);
  const FeatureTaps taps = feature_taps(pixels_per_degree);
  edges_ = features(planes.grey, taps.edge, taps.smooth);
  points_ = features(planes.grey, taps.point, taps.smooth);
  planes.grey = blurred(planes.grey, kAchromatic, pixels_per_degree);
  planes.red_green = blurred(planes.red_green, kRedGreen, pixels_per_degree);
  planes.blue_yellow = blurred_blue_yellow(planes.blue_yellow, pixels_per_degree);
  for (auto& part : colour_) part.resize(edges_.size());
  for (size_t i = 0; i < edges_.size(); ++i) {
    const double y = planes.grey.values[i];
    const std::array<float, 3> lab =
        adjusted_lab(shown({y + planes.red_green.values[i], y, y - planes.blue_yellow.values[i]}));
    for (size_t c = 0; c < lab.size(); ++c) colour_[c][i] = lab[c];
  }
}

std::vector<float> flip_map(const FlipPicture& reference, const FlipPicture& test) {
  frames::require_same_size({reference.geometry_, {}}, {test.geometry_, {}});
  if (reference.pixels_per_degree_ != test.pixels_per_degree_)
    throw Error(ErrorKind::Usage,
                fmt::format("pictures at {} and {} pixels per degree: not comparable",
                            reference.pixels_per_degree_, test.pixels_per_degree_));
  std::vector<float> map(reference.edges_.size());
  const auto lab_of = [](const FlipPicture& picture, size_t i) {
    return std::array{picture.colour_[0][i], picture.colour_[1][i], picture.colour_[2][i]};
  };
  for (size_t i = 0; i < map.size(); ++i) {
    const float feature = std::max(std::abs(reference.edges_[i] - test.edges_[i]),
                                   std::abs(reference.points_[i] - test.points_[i]));
    const float distance = colour_distance(lab_of(reference, i), lab_of(test, i));
    if (feature == 0.0F && distance == 0.0F) continue;  // true for most pixels, and powers are slow
    const float raised = std::clamp(std::sqrt(feature / std::numbers::sqrt2_v<float>), 0.0F, 1.0F);
    map[i] = std::pow(colour_error(distance), 1.0F - raised);
  }
  return map;
}

FlipFigures flip_figures(std::vector<float> map) {
  if (map.empty()) return {};
  double sum = 0.0;
  for (const float value : map) sum += value;
  const double mean = sum / static_cast<double>(map.size());
  const size_t place = (map.size() * 99 + 99) / 100 - 1;
  return {.mean = mean, .percentile_99 = value_in_order(std::move(map), place)};
}

}  // namespace lenticule::lab
