// SPDX-License-Identifier: Apache-2.0
// Tests the lookup kernel against double precision.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "frames/srgb.h"
#include "render/methods/adaptive/key_lookup_kernel.h"
#include "render/shading/light_encoder.h"
#include "tests/support/instruction_sets.h"

namespace lenticule::render {
namespace {

using lookup_kernel::Grid;
using lookup_kernel::Kernel;
using lookup_kernel::Row;
using lookup_kernel::SampleRows;

/// A row of random rays and surfaces with random samples, most of which agree.
struct Case {
  Grid grid{};
  std::vector<uint32_t> keys, groups;
  std::vector<lookup_kernel::Corners> corners;
  std::vector<float> x, tan, z;
  std::vector<int32_t> cuts;
  SampleRows interval{};
  Row row{};

  Case(std::mt19937_64& random, bool parallel);
  void draw_samples(std::mt19937_64& random);
  void draw_row(std::mt19937_64& random, bool parallel);
};

constexpr int kCount = 300;

Case::Case(std::mt19937_64& random, bool parallel) {
  grid = {.x_first = -50.0F,
          .columns_per_mm = 0.7F,
          .eye_first = parallel ? -0.2F : -60.0F,
          .eye_step = parallel ? 0.2F : 60.0F,
          .cache_views_per_eye = parallel ? 5.0F : 1.0F / 60.0F,
          .near = 0.25F,
          .inverse_z = parallel ? 0.0F : 1.0F / 700.0F,
          .distance = parallel ? 0.0F : 700.0F,
          .cache_views = 3,
          .columns = 71,
          .stride = 80};
  draw_samples(random);
  draw_row(random, parallel);
}

void Case::draw_samples(std::mt19937_64& random) {
  const size_t plane = static_cast<size_t>(grid.cache_views * grid.stride);
  keys.resize(plane);
  for (uint32_t& key : keys) {
    key = 2 + static_cast<uint32_t>(random() % 8 == 0 ? random() % 3 : 0);
    if (random() % 8 == 0) key |= lookup_kernel::kUneven;
  }
  corners.resize(3 * plane);
  for (lookup_kernel::Corners& cell : corners)
    for (uint16_t* value : {&cell.above[0], &cell.above[1], &cell.below[0], &cell.below[1]})
      *value = static_cast<uint16_t>(12000 + random() % 900);
  interval = {.key = keys.data(),
              .corners = corners.data(),
              .plane = static_cast<int>(plane),
              .part = {0.25F, 0.75F}};
}

void Case::draw_row(std::mt19937_64& random, bool parallel) {
  std::uniform_real_distribution<float> any(-1.0F, 1.0F);
  groups = {2, 3, 4, 5};
  for (int n = 0; n < kCount; ++n) {
    x.push_back(55.0F * any(random));
    const float eye = 66.0F * any(random);
    tan.push_back(parallel ? 0.22F * any(random) : (eye - x.back()) / 700.0F);
    cuts.push_back(static_cast<int32_t>(random() % 6) - 2);
    if (cuts.back() < 0) cuts.back() = -1;
    z.push_back(cuts.back() < 0 ? -std::numeric_limits<float>::infinity() : 40.0F * any(random));
  }
  for (auto* list : {&x, &tan, &z}) list->resize(kCount + 16);
  cuts.resize(kCount + 16, -1);
  row = {.x = x.data(),
         .tan = tan.data(),
         .z = z.data(),
         .cut = cuts.data(),
         .group = groups.data(),
         .count = kCount,
         .most_apart = 600.0F};
}

/// The result for one subpixel, in double precision.
struct Expected {
  uint8_t state = lookup_kernel::kUnknown;
  double code = 0.0;
  bool close_call = false;  ///< true if rounding may change the result
  double left = 0.0, of_right = 0.0;
  double column[2] = {};  ///< columns in the cache_views on both sides, counted from the left end
                          ///< of a row of samples
};

struct InCacheView {
  uint32_t key = 0;
  double value = 0.0;
  double column = 0.0;  ///< -1 outside the cache_view
  bool close_call = false;
};

InCacheView in_cache_view(const Case& c, int cache_view, double x_panel, int channel) {
  const int odd = cache_view % 2;
  const double column =
      (x_panel - double{c.grid.x_first}) * double{c.grid.columns_per_mm} + 0.5 * odd;
  const double off = std::abs(column - std::round(column));
  InCacheView found{.column = -1.0, .close_call = off < 1e-3};
  if (!(column >= 0.0) || !(column < c.grid.columns - 1)) return found;
  const auto whole = static_cast<size_t>(column);
  const size_t at = static_cast<size_t>(cache_view * c.grid.stride) + whole;
  found.column = cache_view * c.grid.stride + column;
  found.key = c.keys[at];
  const lookup_kernel::Corners& corners =
      c.corners[static_cast<size_t>(channel) * static_cast<size_t>(c.interval.plane) + at];
  const auto value = [&](const uint16_t(&pair)[2]) {
    return std::lerp(static_cast<double>(pair[0]), static_cast<double>(pair[1]),
                     column - static_cast<double>(whole));
  };
  found.value = std::lerp(value(corners.above), value(corners.below), double{c.interval.part[odd]});
  return found;
}

Expected oracle(const Case& c, int n) {
  const auto s = static_cast<size_t>(n);
  if (c.cuts[s] < 0) return {.state = lookup_kernel::kNothing};
  const bool parallel = c.grid.distance == 0.0F;
  const double z = double{c.z[s]}, x = double{c.x[s]} + double{c.tan[s]} * z;
  const double eye =
      parallel ? double{c.tan[s]} : double{c.x[s]} + double{c.tan[s]} * double{c.grid.distance};
  const double number = (eye - double{c.grid.eye_first}) / double{c.grid.eye_step};
  const int left = std::clamp(static_cast<int>(std::max(number, 0.0)), 0, c.grid.cache_views - 2);
  const double part = number - left;
  const auto x_at = [&](int cache_view) {
    const double e = double{c.grid.eye_first} + cache_view * double{c.grid.eye_step};
    return parallel ? x - e * z : (x - e * z / 700.0) / (1.0 - z / 700.0);
  };
  const InCacheView a = in_cache_view(c, left, x_at(left), n % 3);
  const InCacheView b = in_cache_view(c, left + 1, x_at(left + 1), n % 3);
  const uint32_t group = c.groups[static_cast<size_t>(c.cuts[s])];
  const double apart = std::abs(a.value - b.value);
  Expected found{.close_call = a.close_call || b.close_call ||
                               std::abs(number - std::round(number)) < 1e-3 ||
                               std::abs(apart - 600.0) < 2.0 || std::abs(part - 0.25) < 1e-3 ||
                               std::abs(part - 0.75) < 1e-3,
                 .left = static_cast<double>(left),
                 .of_right = std::clamp(part, 0.0, 1.0),
                 .column = {a.column, b.column}};
  const bool any_view = group % 2 == 0;
  const uint32_t uneven = group | lookup_kernel::kUneven;
  double value = 0.0;
  bool known = false;
  if (a.key == group && b.key == group) {
    known = apart <= 600.0;
    value = std::lerp(a.value, b.value, part);
  } else if (a.key == group && b.key != uneven && (any_view || part < 0.25)) {
    known = true;
    value = a.value;
  } else if (b.key == group && a.key != uneven && (any_view || part > 0.75)) {
    known = true;
    value = b.value;
  }
  if (known) found.state = lookup_kernel::kFound;
  found.code = value / lookup_kernel::kCodeParts;
  return found;
}

/// Arrays for the results of a row.
struct FoundArrays {
  static constexpr size_t kRoom = kCount + 16;
  std::vector<uint8_t> codes = std::vector<uint8_t>(kRoom), states = codes;
  std::vector<int32_t> left = std::vector<int32_t>(kRoom), cell[2] = {left, left};
  std::vector<float> of_right = std::vector<float>(kRoom), part[2] = {of_right, of_right};

  [[nodiscard]] lookup_kernel::Found found() {
    return {.codes = codes.data(),
            .states = states.data(),
            .left = left.data(),
            .of_right = of_right.data(),
            .cell = {cell[0].data(), cell[1].data()},
            .part = {part[0].data(), part[1].data()}};
  }
  void expect_places(const Expected& expected, size_t at) const {
    EXPECT_EQ(left[at], expected.left);
    EXPECT_NEAR(double{of_right[at]}, expected.of_right, 1e-4);
    for (const size_t side : {0U, 1U}) {
      EXPECT_EQ(cell[side][at], std::floor(expected.column[side]));
      if (cell[side][at] >= 0) {
        EXPECT_NEAR(cell[side][at] + double{part[side][at]}, expected.column[side], 1e-3);
      }
    }
  }
};

class KeyLookup : public ::testing::TestWithParam<Isa> {};

TEST_P(KeyLookup, AgreesWithDoublePrecision) {
  std::mt19937_64 random(11);
  int found = 0, unknown = 0;
  for (int round = 0; round < 60; ++round) {
    const Case c(random, round % 2 != 0);
    FoundArrays arrays;
    LENTICULE_SELECT_KERNEL(GetParam(), kLookupKernel)
        .look_up(c.grid, c.interval, c.row, arrays.found());
    const auto &codes = arrays.codes, &states = arrays.states;
    for (int n = 0; n < kCount; ++n) {
      const Expected expected = oracle(c, n);
      if (expected.close_call) continue;
      const auto s = static_cast<size_t>(n);
      ASSERT_EQ(states[s], expected.state) << "round " << round << " subpixel " << n;
      if (states[s] == lookup_kernel::kFound) {
        ASSERT_NEAR(double{static_cast<double>(codes[s])}, expected.code, 0.51);
      }
      if (states[s] == lookup_kernel::kUnknown) arrays.expect_places(expected, s);
      found += states[s] == lookup_kernel::kFound ? 1 : 0;
      unknown += states[s] == lookup_kernel::kUnknown ? 1 : 0;
    }
  }
  EXPECT_GT(found, 1500);
  EXPECT_GT(unknown, 1500);
}

TEST_P(KeyLookup, GivesTheSameBytesAsThePlainKernel) {
  std::mt19937_64 random(12);
  for (int round = 0; round < 60; ++round) {
    const Case c(random, round % 2 != 0);
    FoundArrays best, plain;
    LENTICULE_SELECT_KERNEL(GetParam(), kLookupKernel)
        .look_up(c.grid, c.interval, c.row, best.found());
    isa_baseline::kLookupKernel.look_up(c.grid, c.interval, c.row, plain.found());
    ASSERT_EQ(best.states, plain.states);
    ASSERT_EQ(best.codes, plain.codes);
    for (size_t n = 0; n < kCount; ++n) {
      if (best.states[n] != lookup_kernel::kUnknown) continue;
      ASSERT_EQ(best.left[n], plain.left[n]);
      ASSERT_EQ(best.of_right[n], plain.of_right[n]);
      for (const size_t side : {0U, 1U}) {
        ASSERT_EQ(best.cell[side][n], plain.cell[side][n]);
        ASSERT_EQ(best.part[side][n], plain.part[side][n]);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(InstructionSets, KeyLookup,
                         ::testing::ValuesIn(test::every_instruction_set()),
                         [](const auto& isa) { return std::string(isa_name(isa.param)); });

TEST(LightEncoder, IsCloseToTheExactCurve) {
  const LightEncoder managed(true), straight(false);
  for (int n = -10; n <= 10010; ++n) {
    const float light = static_cast<float>(n) / 10000.0F;
    const double held = std::clamp(double{light}, 0.0, 1.0);
    EXPECT_NEAR(managed.parts(light),
                frames::srgb_from_linear(held) * 255.0 * lookup_kernel::kCodeParts, 1.0);
    EXPECT_NEAR(straight.parts(light), held * 255.0 * lookup_kernel::kCodeParts, 0.51);
  }
  EXPECT_EQ(managed.parts(std::numeric_limits<float>::quiet_NaN()), 0);
}

TEST(LightEncoder, HasTheCodesOfFull) {
  const LightEncoder managed(true), straight(false);
  std::vector<float> all = {-1.0F, 2.0F, INFINITY, -INFINITY, std::nanf("")};
  for (int n = 0; n <= 1 << 20; ++n) all.push_back(static_cast<float>(n) / (1 << 20));
  for (int code = 0; code < 255; ++code) {
    const auto limit = static_cast<float>(frames::linear_from_srgb((code + 0.5) / 255.0));
    for (const float near : {std::nextafter(limit, 0.0F), limit, std::nextafter(limit, 1.0F)})
      all.push_back(near);
  }
  for (const float light : all) {
    ASSERT_EQ(managed.code(light), frames::code_from_linear(double{light})) << light;
    ASSERT_EQ(straight.code(light), frames::code_from_encoded(light)) << light;
  }
}

}  // namespace
}  // namespace lenticule::render
