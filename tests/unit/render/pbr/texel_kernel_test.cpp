// SPDX-License-Identifier: Apache-2.0
// Compares the look-ups of every instruction set with a plain one in double precision, and with
// each other.
#include "render/textures/texel_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "frames/srgb.h"

namespace lenticule::render {
namespace {

using namespace texel_kernel;

std::vector<const Kernel*> runnable_kernels() {
  std::vector<const Kernel*> kernels = {&isa_baseline::kTexelKernel};
#if defined(__x86_64__)
  if (isa_supported(Isa::Avx2)) kernels.push_back(&isa_avx2::kTexelKernel);
  if (isa_supported(Isa::Avx512)) kernels.push_back(&isa_avx512::kTexelKernel);
#elif defined(__aarch64__)
  kernels.push_back(&isa_neon::kTexelKernel);
#endif
  return kernels;
}

const float* light_of_code() {
  static const std::vector<float> light(frames::linear_of_codes().begin(),
                                        frames::linear_of_codes().end());
  return light.data();
}

/// Returns the place in the picture, 0 to 1, of a coordinate.
double place_of(double c, bool repeat, bool mirror) {
  if (!(std::abs(c) < 1e15)) c = 0.0;
  if (!repeat) return std::clamp(c, 0.0, 1.0);
  if (!mirror) return c - std::floor(c);
  const double in_pair = c - 2.0 * std::floor(0.5 * c);
  return in_pair > 1.0 ? 2.0 - in_pair : in_pair;
}

/// The axes of the ellipse around a parallelogram, in texels.
struct Ellipse {
  double minor, major;
  double direction[2];  ///< unit vector along the longer axis
};
Ellipse ellipse_around(double ax, double ay, double bx, double by) {
  const double xx = ax * ax + bx * bx, yy = ay * ay + by * by, xy = ax * ay + bx * by;
  const double apart = std::hypot(0.5 * (xx - yy), xy);
  const double major = std::sqrt(0.5 * (xx + yy) + apart);
  const double angle = 0.5 * std::atan2(2.0 * xy, xx - yy);
  return {.minor = major > 0.0 ? std::abs(ax * by - ay * bx) / major : 0.0,
          .major = major,
          .direction = {std::cos(angle), std::sin(angle)}};
}

/// A texture with random texels and all its levels, which are random, too.
class TexelKernel : public ::testing::Test {
 protected:
  TexelKernel() {
    for (const auto& size : kSizes) {
      codes_.emplace_back(size_t{4} * size[0] * size[1]);
      for (uint8_t& code : codes_.back()) code = static_cast<uint8_t>(random_());
      if (codes_.size() > 1) make_unit_vectors(codes_.back());
      values_.emplace_back(codes_.back().begin(), codes_.back().end());
      for (float& value : values_.back()) value /= 255.0F;
    }
    for (size_t n = 0; n < std::size(kSizes); ++n) {
      of_codes_.push_back({kSizes[n][0], kSizes[n][1], codes_[n].data(), nullptr, n == 0 ? 1 : 0});
      of_values_.push_back(
          {kSizes[n][0], kSizes[n][1], nullptr, values_[n].data(), n == 0 ? 1 : 0});
    }
  }

  /// Levels of normal maps hold unit vectors; all texels of these levels do.
  void make_unit_vectors(std::vector<uint8_t>& codes) {
    std::normal_distribution<double> part;
    for (size_t texel = 0; texel < codes.size(); texel += 4) {
      const double v[] = {part(random_), part(random_), part(random_)};
      for (size_t c = 0; c < 3; ++c)
        codes[texel + c] =
            static_cast<uint8_t>(127.5 * (1.0 + v[c] / std::hypot(v[0], v[1], v[2])) + 0.5);
    }
  }
  [[nodiscard]] TextureLevels random_texture() {
    return {.levels = of_codes_.data(),
            .count = static_cast<int32_t>(of_codes_.size()),
            .content = static_cast<Content>(random_() % 3),
            .light_of_code = light_of_code(),
            .repeat = {int32_t(random_() % 2), int32_t(random_() % 2)},
            .mirror = {int32_t(random_() % 2), int32_t(random_() % 2)}};
  }
  [[nodiscard]] Area random_area() {
    std::uniform_real_distribution<double> anywhere(-3.0, 3.0);
    std::uniform_real_distribution<float> direction(-1.0F, 1.0F), size(-9.0F, 2.0F);
    constexpr double kOdd[] = {0.0, -0.0, 1.0, -1.0, 0.5, 1e14, -1e300, INFINITY, NAN};
    Area area;
    for (int r = 0; r < kLanes; ++r) {
      for (double(&c)[kLanes] : area.middle)
        c[r] = random_() % 16 == 0 ? kOdd[random_() % std::size(kOdd)] : anywhere(random_);
      for (auto* side : {&area.across, &area.along}) {
        const float length = random_() % 8 == 0 ? 0.0F : std::exp2(size(random_));
        for (float(&c)[kLanes] : *side) c[r] = length * direction(random_);
      }
    }
    return area;
  }
  static Values mean_of(const Kernel& kernel, const TextureLevels& texture, const Area& area) {
    Lookup lookup;
    kernel.find(texture, area, lookup);
    Values mean;
    kernel.mean(texture, lookup, mean);
    return mean;
  }
  /// Returns a channel of a texel in the form that is averaged.
  static double channel_of(const TextureLevels& texture, int level, int x, int y, size_t c) {
    const Level& from = texture.levels[level];
    const auto value = [&](size_t n) {
      const uint8_t code = from.codes[4 * (size_t(y) * size_t(from.width) + size_t(x)) + n];
      return texture.content == Content::Colour && n < 3 ? frames::linear_of_codes()[code]
                                                         : code / 255.0;
    };
    if (texture.content != Content::Normals) return value(c);
    const double length =
        std::hypot(2.0 * value(0) - 1.0, 2.0 * value(1) - 1.0, 2.0 * value(2) - 1.0);
    return (2.0 * value(c) - 1.0) / length * (level == 0 ? 1.0 : 1.0 - value(3) * value(3));
  }
  static double bilinear(const TextureLevels& texture, int level, double u, double v, size_t c) {
    struct Pair {
      int first, second;
      double part;
    };
    const auto corners = [](double at, int size, bool repeats, bool mirrors) -> Pair {
      const double texel = place_of(at, repeats, mirrors) * size - 0.5;
      const auto inside = [&](int n) {
        return repeats && !mirrors ? (n + size) % size : std::clamp(n, 0, size - 1);
      };
      const int left = static_cast<int>(std::floor(texel));
      return {inside(left), inside(left + 1), texel - left};
    };
    const Level& of = texture.levels[level];
    const Pair x = corners(u, of.width, texture.repeat[0] != 0, texture.mirror[0] != 0);
    const Pair y = corners(v, of.height, texture.repeat[1] != 0, texture.mirror[1] != 0);
    const auto row = [&](int number) {
      return (1.0 - x.part) * channel_of(texture, level, x.first, number, c) +
             x.part * channel_of(texture, level, x.second, number, c);
    };
    return (1.0 - y.part) * row(y.first) + y.part * row(y.second);
  }
  /// Returns the mean that the kernel computes, or a negative number where the number of places
  /// depends on rounding.
  static double expected(const TextureLevels& texture, const Area& area, int lane, size_t c) {
    const double width = texture.levels[0].width, height = texture.levels[0].height;
    const Ellipse ellipse =
        ellipse_around(double{area.across[0][lane]} * width, double{area.across[1][lane]} * height,
                       double{area.along[0][lane]} * width, double{area.along[1][lane]} * height);
    const double wide = std::max({ellipse.minor, ellipse.major / kPlaces, 1.0});
    const double longer = ellipse.major / wide;
    if (std::abs(longer - std::round(longer)) < 1e-4 && longer > 0.5 && longer < kPlaces - 0.5)
      return -2.0;
    const int places = std::clamp(static_cast<int>(std::ceil(longer - 1e-5)), 1, kPlaces);
    const double depth = std::min(std::log2(wide), texture.count - 1.0);
    const int level = static_cast<int>(depth);
    const double length = places > 1 ? ellipse.major : 0.0;
    double sum = 0.0;
    for (int n = 0; n < places; ++n) {
      const double way = length * ((n + 0.5) / places - 0.5);
      const double u = area.middle[0][lane] + ellipse.direction[0] * way / width;
      const double v = area.middle[1][lane] + ellipse.direction[1] * way / height;
      const double sharp = bilinear(texture, level, u, v, c);
      sum += sharp;
      if (depth > level) sum += (depth - level) * (bilinear(texture, level + 1, u, v, c) - sharp);
    }
    return sum / places;
  }

  static constexpr int32_t kSizes[][2] = {{31, 18}, {15, 9}, {7, 4}, {3, 2}, {1, 1}};
  std::mt19937 random_{3};
  std::vector<std::vector<uint8_t>> codes_;
  std::vector<std::vector<float>> values_;
  std::vector<Level> of_codes_, of_values_;
};

/// One texel more or less changes a mean by as much as its weight, which rounding can change by
/// 1e-5 of a texel.
TEST_F(TexelKernel, IsTheMeanOverTheEllipse) {
  const Kernel& kernel = isa_baseline::kTexelKernel;
  int compared = 0;
  for (int round = 0; round < 500; ++round) {
    const TextureLevels texture = random_texture();
    const Area area = random_area();
    const Values mean = mean_of(kernel, texture, area);
    for (int r = 0; r < kLanes; ++r)
      for (size_t c = 0; c < (texture.content == Content::Normals ? 3U : 4U); ++c) {
        const double wanted = expected(texture, area, r, c);
        if (wanted < -1.5) continue;
        ASSERT_NEAR(mean.channel[c][r], wanted, 1e-4) << "round " << round << ", lane " << r;
        ++compared;
      }
  }
  EXPECT_GT(compared, 20000);
}

TEST_F(TexelKernel, DecodesColoursWithinTheirRounding) {
  const Kernel& kernel = isa_baseline::kTexelKernel;
  std::vector<uint8_t> codes;
  for (int code = 0; code < 256; ++code) codes.insert(codes.end(), 4, static_cast<uint8_t>(code));
  const Level level{256, 1, codes.data(), nullptr, 1};
  const TextureLevels texture{
      .levels = &level, .count = 1, .content = Content::Colour, .light_of_code = light_of_code()};
  for (int first = 0; first < 256; first += kLanes) {
    Area area{};
    for (int r = 0; r < kLanes; ++r) area.middle[0][r] = (first + r + 0.5) / 256.0;
    const Values mean = mean_of(kernel, texture, area);
    for (int r = 0; r < kLanes; ++r) {
      EXPECT_NEAR(mean.channel[1][r], frames::linear_of_codes()[size_t(first + r)], 2e-6);
      EXPECT_NEAR(mean.channel[3][r], (first + r) / 255.0, 1e-7);
    }
  }
}

/// The same bits on every instruction set, for codes and for values.
TEST_F(TexelKernel, GivesTheSameBitsOnEveryInstructionSet) {
  const std::vector<const Kernel*> kernels = runnable_kernels();
  for (int round = 0; round < 500; ++round) {
    TextureLevels texture = random_texture();
    if (round % 2 != 0) texture.levels = of_values_.data();
    const Area area = random_area();
    const Values wanted = mean_of(*kernels[0], texture, area);
    for (const Kernel* kernel : kernels) {
      const Values mean = mean_of(*kernel, texture, area);
      ASSERT_EQ(std::memcmp(&wanted, &mean, sizeof mean), 0) << "round " << round;
    }
  }
}

}  // namespace
}  // namespace lenticule::render
