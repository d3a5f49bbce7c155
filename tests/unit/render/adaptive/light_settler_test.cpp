// SPDX-License-Identifier: Apache-2.0
// Tests the light that the samples resolve for a subpixel, against the corners evaluated one by
// one.
#include "render/methods/adaptive/light_settler.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

constexpr SoftLight kSoft{.shadow_samples = 16, .occlusion_samples = 16};

/// A corner that shows the same surface, with its interpolation weight.
struct Corner {
  KeySamples::Light light;
  double weight;
};

class SettledSamples : public ::testing::Test {
 protected:
  SettledSamples()
      : rig_(testing::make_rig({.width = 60, .height = 48})),
        model_(rig_),
        planes_(model_, Isa::Baseline),
        grid_(planes_, testing::make_tiny_stage(), reach_of(planes_),
              {.row_step = 4, .columns = 4.0, .pictures = 3}),
        samples_(grid_) {
    for (int row = 0; row < grid_.rows(); ++row)
      for (int picture = 0; picture < grid_.pictures(); ++picture)
        for (int column = 0; column < grid_.columns(); ++column)
          samples_.set(row, picture, column, draw_sample());
  }

  /// Draws a sample: surfaces 4 and 8 are adjacent; most lights and path ids are equal.
  KeySamples::Sample draw_sample() {
    const auto one_in = [&](uint64_t n) { return random_() % n == 0; };
    KeySamples::Sample sample{.group = one_in(4) ? 8U : 4U};
    sample.light = {.lit = one_in(8) ? 1U : 3U,
                    .hidden = one_in(8) ? 0U : 4U,
                    .secondary_way = one_in(12) ? 5U : 6U,
                    .around = one_in(12) ? LightNotes::kNoShare
                                         : 0.5F + 0.05F * static_cast<float>(random_() % 6)};
    for (size_t lamp = 0; lamp < sample.light.seen.size(); ++lamp)
      sample.light.seen[lamp] = one_in(4) ? KeySamples::Light::kNotShining
                                          : static_cast<uint8_t>(random_() % (30 * lamp + 1));
    for (float& light : sample.light.secondary)
      light = one_in(3) ? 0.0F : 0.02F * static_cast<float>(random_() % 5);
    return sample;
  }
  LightSettler::Place draw_place(int picture) {
    std::uniform_real_distribution<float> part(0.0F, 1.0F);
    const auto column = static_cast<int>(random_() % static_cast<uint64_t>(grid_.columns() - 1));
    return {.cell = random_() % 16 == 0 ? -1 : picture * grid_.stride() + column,
            .part = part(random_),
            .weight = 0.0F,
            .odd = static_cast<size_t>(picture % 2)};
  }
  LightSettler::Point draw_point(int panel_row) {
    const int left = static_cast<int>(random_() % 2);
    std::uniform_real_distribution<float> part(0.0F, 1.0F);
    const float of_right = random_() % 4 == 0 ? 0.0F : part(random_);
    LightSettler::Point point{.rows = grid_.between(panel_row),
                              .places = {draw_place(left), draw_place(left + 1)},
                              .group = random_() % 4 == 0 ? 8U : 4U,
                              .channel = static_cast<int>(random_() % 3)};
    point.places[0].weight = 1.0F - of_right;
    point.places[1].weight = of_right;
    return point;
  }

  std::vector<Corner> corners_of(const LightSettler::Point& point, double& weight_of_pictures) {
    std::vector<Corner> corners;
    weight_of_pictures = 0.0;
    for (const LightSettler::Place& place : point.places) {
      if (place.cell < 0) continue;
      const size_t before = corners.size();
      for (const int below : {0, 1})
        for (const int next : {0, 1}) {
          const size_t row = static_cast<size_t>(point.rows.above[place.odd] + below);
          const size_t at = row * grid_.row_samples() + static_cast<size_t>(place.cell + next);
          if (samples_.group(at) != point.group) continue;
          const double down = double{point.rows.part[place.odd]}, along = double{place.part};
          corners.push_back(
              {samples_.light(at), double{place.weight} * (below != 0 ? down : 1.0 - down) *
                                           (next != 0 ? along : 1.0 - along) +
                                       1e-3});
        }
      if (corners.size() > before) weight_of_pictures += double{place.weight};
    }
    return corners;
  }

  void expect_settled(const LightSettler::Point& point, const SettledLight& settled,
                      const SettledLamps& lamps, bool colour_managed) {
    double weight_of_pictures = 0.0;
    const std::vector<Corner> corners = corners_of(point, weight_of_pictures);
    if (corners.size() < 3) {
      EXPECT_EQ(settled.lit | settled.hidden, 0U);
      EXPECT_FALSE(settled.secondary_known || settled.around_known);
      EXPECT_EQ(settled.lamps_known, 0U);
      EXPECT_EQ(settled.wanted, SettledLight::kAllSamples);
      return;
    }
    uint32_t lit = ~0U, hidden = ~0U;
    bool same_way = true;
    const auto c = static_cast<size_t>(point.channel);
    double low = 1e9, high = -1e9, least = 1e9, most = -1e9, light = 0.0, around = 0.0, sum = 0.0;
    for (const Corner& corner : corners) {
      lit &= corner.light.lit;
      hidden &= corner.light.hidden;
      same_way = same_way && corner.light.secondary_way == corners[0].light.secondary_way;
      low = std::min(low, double{corner.light.secondary[c]});
      high = std::max(high, double{corner.light.secondary[c]});
      least = std::min(least, double{corner.light.around});
      most = std::max(most, double{corner.light.around});
      light += corner.weight * double{corner.light.secondary[c]};
      around += corner.weight * double{corner.light.around};
      sum += corner.weight;
    }
    EXPECT_EQ(settled.lit, lit);
    EXPECT_EQ(settled.hidden, hidden);
    const double apart = colour_managed ? std::sqrt(high) - std::sqrt(low) : high - low;
    const double limit = double{agreement_.secondary} * (same_way ? 1.0 : 0.5);
    const double missing = 1.0 - double{grid_.lookup().near} - weight_of_pictures;
    if (std::abs(apart - limit) > 1e-6 && std::abs(missing) > 1e-6) {
      EXPECT_EQ(settled.secondary_known, missing < 0.0 && apart < limit);
    }
    if (settled.secondary_known) {
      EXPECT_NEAR(double{settled.secondary}, light / sum, 1e-6);
      ++known_;
    }
    if (std::abs(most - least - double{agreement_.around}) > 1e-6) {
      EXPECT_EQ(settled.around_known, least >= 0.0 && most - least < double{agreement_.around});
    }
    if (settled.around_known) {
      EXPECT_NEAR(double{settled.around}, around / sum, 1e-6);
    }
    ++settled_;
    uint8_t wanted = settled.around_known ? SettledLight::kNoSamples : SettledLight::kAllSamples;
    for (size_t lamp = 0; lamp < LightNotes::kLamps; ++lamp)
      if (!expect_lamp(corners, settled, lamps, lamp) && wanted == SettledLight::kNoSamples)
        wanted = static_cast<uint8_t>(lamp);
    EXPECT_EQ(settled.wanted, wanted);
  }

  [[nodiscard]] SettledLamps lamps_of(const SettledLight& settled) const {
    return settled.lamps_known != 0 ? lamps_.at(settled.lamps) : SettledLamps{};
  }

  /// Checks one area light; returns false if rays to the light are needed.
  bool expect_lamp(const std::vector<Corner>& corners, const SettledLight& settled,
                   const SettledLamps& lamps, size_t lamp) {
    int low = 255, high = 0, shining = 0;
    double sum = 0.0, weights = 0.0;
    for (const Corner& corner : corners) {
      const uint8_t seen = corner.light.seen[lamp];
      if (seen == KeySamples::Light::kNotShining) continue;
      ++shining;
      low = std::min(low, int{seen});
      high = std::max(high, int{seen});
      sum += corner.weight * seen;
      weights += corner.weight;
    }
    const double apart = static_cast<double>(high - low) / KeySamples::Light::kWholeLamp;
    const bool expected = shining >= 2 && apart <= double{agreement_.seen};
    EXPECT_EQ((settled.lamps_known >> lamp & 1) != 0, expected);
    if (expected) {
      ++(high == low ? same_lamps_ : other_lamps_);
      EXPECT_NEAR(static_cast<double>(lamps.seen[lamp]) / SettledLamps::kWholeLamp,
                  sum / weights / KeySamples::Light::kWholeLamp, 1e-4);
      EXPECT_NEAR(static_cast<double>(lamps.apart[lamp]) / SettledLamps::kWholeLamp, apart, 1e-4);
    }
    return expected || shining == 0;
  }

  optics::Rig rig_;
  optics::OpticalModel model_;
  RowPlanes planes_;
  KeyGrid grid_;
  KeySamples samples_;
  Agreement agreement_ = Agreement::for_error(2.0);
  std::mt19937_64 random_{3};
  std::vector<SettledLamps> lamps_;
  int settled_ = 0, known_ = 0, same_lamps_ = 0, other_lamps_ = 0;
};

TEST_F(SettledSamples, AgreeWithTheirCornersIfAllCornersAgree) {
  for (const bool colour_managed : {false, true}) {
    LightSettler settler(samples_, grid_, agreement_, colour_managed, kSoft);
    for (int row = 0; row < planes_.rows(); ++row)
      for (int n = 0; n < 300; ++n) {
        const LightSettler::Point point = draw_point(row);
        SettledLight settled;
        settler.settle(point, settled, lamps_);
        expect_settled(point, settled, lamps_of(settled), colour_managed);
      }
  }
  EXPECT_GT(settled_, 10000);
  EXPECT_GT(known_, 500);
  EXPECT_GT(settled_ - known_, 500);
  EXPECT_GT(same_lamps_, 500);
  EXPECT_GT(other_lamps_, 500);
}

/// Cells are cached by row and surface, independently of earlier lookups.
TEST_F(SettledSamples, DoNotDependOnEarlierLookups) {
  LightSettler used(samples_, grid_, agreement_, false, kSoft);
  for (int n = 0; n < 3000; ++n) {
    const auto row = static_cast<int>(random_() % static_cast<uint64_t>(planes_.rows()));
    const LightSettler::Point point = draw_point(row);
    LightSettler fresh(samples_, grid_, agreement_, false, kSoft);
    SettledLight once, again;
    used.settle(point, once, lamps_);
    fresh.settle(point, again, lamps_);
    ASSERT_EQ(once.lit, again.lit);
    ASSERT_EQ(once.hidden, again.hidden);
    ASSERT_EQ(once.secondary_known, again.secondary_known);
    ASSERT_EQ(once.secondary, again.secondary);
    ASSERT_EQ(once.around_known, again.around_known);
    ASSERT_EQ(once.around, again.around);
    ASSERT_EQ(once.wanted, again.wanted);
    ASSERT_EQ(once.lamps_known, again.lamps_known);
    ASSERT_EQ(lamps_of(once).seen, lamps_of(again).seen);
    ASSERT_EQ(lamps_of(once).apart, lamps_of(again).apart);
  }
}

/// If occlusion is not sampled, no caller requests it.
TEST_F(SettledSamples, SkipUnrequestedLight) {
  LightSettler settler(samples_, grid_, agreement_, false, {});
  for (int n = 0; n < 500; ++n) {
    SettledLight settled;
    settler.settle(draw_point(7), settled, lamps_);
    EXPECT_FALSE(settled.around_known);
    EXPECT_EQ(settled.lamps_known, 0U);
    EXPECT_EQ(settled.wanted, SettledLight::kNoSamples);
  }
  EXPECT_TRUE(lamps_.empty());
}

}  // namespace
}  // namespace lenticule::render
