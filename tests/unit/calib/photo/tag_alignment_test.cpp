// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "calib/photo/tag_finder.h"

namespace lenticule::calib {
namespace {

constexpr int kId = 42, kSide = 120;

/// Place is where a tag lies in a picture: its middle, and the sides of a cell in pixels, which
/// `narrowing` makes shorter toward the bottom.
struct Place {
  Vec2 middle, right, down;
  double narrowing = 0.0;

  [[nodiscard]] Vec2 pixel(Vec2 cell) const {
    const double x = cell.x - 0.5 * kTagCells, y = cell.y - 0.5 * kTagCells;
    return middle + (right * x + down * y) * (1.0 / (1.0 + narrowing * y));
  }
  /// Solves pixel() = p.
  [[nodiscard]] Vec2 cell(Vec2 p) const {
    const Vec2 d = p - middle;
    const Vec2 lower = down - d * narrowing;
    const double area = right.x * lower.y - right.y * lower.x;
    const double x = (d.x * lower.y - d.y * lower.x) / area;
    const double y = (right.x * d.y - right.y * d.x) / area;
    return {x + 0.5 * kTagCells, y + 0.5 * kTagCells};
  }
  [[nodiscard]] std::array<Vec2, 4> corners() const {
    return {pixel({1.0, 9.0}), pixel({9.0, 9.0}), pixel({9.0, 1.0}), pixel({1.0, 1.0})};
  }
};

double light_at(const std::vector<bool>& white, Vec2 cell) {
  constexpr double kFringes = 0.5;
  if (!(std::min(cell.x, cell.y) >= 0.0 && std::max(cell.x, cell.y) < kTagCells)) return kFringes;
  return white[static_cast<size_t>(cell.y) * kTagCells + static_cast<size_t>(cell.x)] ? 0.9 : 0.1;
}

/// Blurs along one direction with a Gaussian of the standard deviation `sigma`.
std::vector<float> blurred(const std::vector<float>& light, double sigma, int step) {
  std::vector<float> out(light.size());
  for (size_t at = 0; at < light.size(); ++at) {
    double sum = 0.0, weights = 0.0;
    const int along = (step == 1 ? static_cast<int>(at) : static_cast<int>(at) / kSide) % kSide;
    for (int k = std::max(-8, -along); k <= std::min(8, kSide - 1 - along); ++k) {
      const double weight = std::exp(-0.5 * k * k / (sigma * sigma));
      sum += weight * light[static_cast<size_t>(static_cast<int>(at) + k * step)];
      weights += weight;
    }
    out[at] = static_cast<float>(sum / weights);
  }
  return out;
}

PhotoLight photographed(const Place& place, double blur_px) {
  constexpr int kSamples = 4;
  const std::vector<bool> white = TagFamily().cells(kId);
  PhotoLight picture{kSide, kSide, {}};
  for (int j = 0; j < kSide; ++j)
    for (int i = 0; i < kSide; ++i) {
      double sum = 0.0;
      for (int k = 0; k < kSamples * kSamples; ++k)
        sum += light_at(white, place.cell({i + (k % kSamples + 0.5) / kSamples,
                                           j + (k / kSamples + 0.5) / kSamples}));
      picture.light.push_back(static_cast<float>(sum / (kSamples * kSamples)));
    }
  picture.light = blurred(blurred(picture.light, blur_px, 1), blur_px, kSide);
  return picture;
}

double farthest(const std::array<Vec2, 4>& one, const std::array<Vec2, 4>& other) {
  double most = 0.0;
  for (size_t k = 0; k < one.size(); ++k)
    most = std::max(most, std::hypot(one[k].x - other[k].x, one[k].y - other[k].y));
  return most;
}

TEST(TagAlignment, FindsTheCornersWithinATwentiethOfAPixelForEveryPlaceAndBlur) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> part(-1.0, 1.0);
  const std::vector<bool> white = TagFamily().cells(kId);
  for (int n = 0; n < 10; ++n) {
    const double angle = 3.1 * part(random), cell = 6.0 + part(random);
    const Place place{{60.0 + part(random), 60.0 + part(random)},
                      {cell * std::cos(angle), cell * std::sin(angle)},
                      {-0.9 * cell * std::sin(angle), 0.9 * cell * std::cos(angle)},
                      0.01 * part(random)};
    const PhotoLight picture = photographed(place, 1.4 + 0.6 * part(random));
    TagSighting start{kId, place.corners()};
    for (Vec2& corner : start.corners_px) corner = corner + Vec2{part(random), part(random)};
    EXPECT_LT(farthest(aligned(picture, start, white).corners_px, place.corners()), 0.05) << n;
  }
}

TEST(TagAlignment, NoiseOfATenthMovesTheCornersByLessThanATenthOfAPixel) {
  std::mt19937 random(8);
  std::normal_distribution<float> noise(0.0F, 0.08F);
  const Place place{{60.3, 59.6}, {7.0, 0.6}, {-0.5, 6.5}, 0.004};
  PhotoLight picture = photographed(place, 1.5);
  for (float& light : picture.light) light += noise(random);
  const TagSighting start{kId, place.corners()};
  EXPECT_LT(farthest(aligned(picture, start, TagFamily().cells(kId)).corners_px, place.corners()),
            0.1);
}

TEST(TagAlignment, APictureWithoutTheTagLeavesItsCornersWhereTheyWere) {
  const Place place{{60.0, 60.0}, {6.0, 0.0}, {0.0, 6.0}, 0.0};
  const TagSighting start{kId, place.corners()};
  const std::vector<bool> white = TagFamily().cells(kId);
  const PhotoLight even{kSide, kSide, std::vector<float>(kSide * kSide, 0.4F)};
  EXPECT_EQ(farthest(aligned(even, start, white).corners_px, start.corners_px), 0.0);
  PhotoLight dark = photographed(place, 1.5);
  std::ranges::fill(dark.light, std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(farthest(aligned(dark, start, white).corners_px, start.corners_px), 0.0);
  const TagSighting point{kId, {}};
  EXPECT_EQ(farthest(aligned(even, point, white).corners_px, point.corners_px), 0.0);
  PhotoLight negative = photographed(place, 1.5);
  for (float& light : negative.light) light = 1.0F - light;
  EXPECT_EQ(farthest(aligned(negative, start, white).corners_px, start.corners_px), 0.0);
}

TEST(TagAlignment, AHalfHiddenTagMovesByHalfACellAtMost) {
  const Place place{{60.0, 60.0}, {6.0, 0.0}, {0.0, 6.0}, 0.0};
  PhotoLight picture = photographed(place, 1.5);
  for (int j = 0; j < kSide; ++j) std::fill_n(picture.light.begin() + j * kSide, kSide / 2, 0.5F);
  const TagSighting start{kId, place.corners()};
  EXPECT_LE(farthest(aligned(picture, start, TagFamily().cells(kId)).corners_px, start.corners_px),
            3.0);
}

}  // namespace
}  // namespace lenticule::calib
