// SPDX-License-Identifier: Apache-2.0
// Tests the light that the samples resolve for a subpixel, against the corners evaluated one by
// one.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "render/methods/adaptive/retrace.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

constexpr SoftLight kSoft{.shadow_samples = 16, .occlusion_samples = 16};

/// A corner that shows the same surface, with its interpolation weight.
struct Corner {
  KeySamples::Light light;
  double weight;
};

class ResolvedSamples : public ::testing::Test {
 protected:
  ResolvedSamples()
      : rig_(test::make_rig({.width = 60, .height = 48})),
        model_(rig_),
        planes_(model_, Isa::Baseline),
        grid_(planes_, test::make_tiny_stage(), reach_of(planes_),
              {.row_step = 4, .columns = 4.0, .cache_views = 3}),
        samples_(grid_) {
    for (int row = 0; row < grid_.rows(); ++row)
      for (int cache_view = 0; cache_view < grid_.cache_views(); ++cache_view)
        for (int column = 0; column < grid_.columns(); ++column)
          samples_.set(row, cache_view, column, draw_sample());
  }

  /// Draws a sample: surfaces 4 and 8 are adjacent; most lights and path ids are equal.
  KeySamples::Sample draw_sample() {
    const auto one_in = [&](uint64_t n) { return random_() % n == 0; };
    KeySamples::Sample sample{.group = one_in(4) ? 8U : 4U};
    sample.light = {.lit = one_in(8) ? 1U : 3U,
                    .hidden = one_in(8) ? 0U : 4U,
                    .secondary_way = one_in(12) ? 5U : 6U,
                    .around = one_in(12) ? LightRecord::kNoShare
                                         : 0.5F + 0.05F * static_cast<float>(random_() % 6)};
    for (size_t area_light = 0; area_light < sample.light.seen.size(); ++area_light)
      sample.light.seen[area_light] = one_in(4)
                                          ? KeySamples::Light::kNotShining
                                          : static_cast<uint8_t>(random_() % (30 * area_light + 1));
    for (float& light : sample.light.secondary)
      light = one_in(3) ? 0.0F : 0.02F * static_cast<float>(random_() % 5);
    return sample;
  }
  LightResolver::Place draw_place(int cache_view) {
    std::uniform_real_distribution<float> part(0.0F, 1.0F);
    const auto column = static_cast<int>(random_() % static_cast<uint64_t>(grid_.columns() - 1));
    return {.cell = random_() % 16 == 0 ? -1 : cache_view * grid_.stride() + column,
            .part = part(random_),
            .weight = 0.0F,
            .odd = static_cast<size_t>(cache_view % 2)};
  }
  LightResolver::Point draw_point(int panel_row) {
    const int left = static_cast<int>(random_() % 2);
    std::uniform_real_distribution<float> part(0.0F, 1.0F);
    const float of_right = random_() % 4 == 0 ? 0.0F : part(random_);
    LightResolver::Point point{.rows = grid_.between(panel_row),
                               .places = {draw_place(left), draw_place(left + 1)},
                               .group = random_() % 4 == 0 ? 8U : 4U,
                               .channel = static_cast<int>(random_() % 3)};
    point.places[0].weight = 1.0F - of_right;
    point.places[1].weight = of_right;
    return point;
  }

  std::vector<Corner> corners_of(const LightResolver::Point& point, double& weight_of_views) {
    std::vector<Corner> corners;
    weight_of_views = 0.0;
    for (const LightResolver::Place& place : point.places) {
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
      if (corners.size() > before) weight_of_views += double{place.weight};
    }
    return corners;
  }

  void expect_resolved(const LightResolver::Point& point, const ResolvedLight& resolved,
                       const ResolvedAreaLights& area_lights, bool colour_managed) {
    double weight_of_views = 0.0;
    const std::vector<Corner> corners = corners_of(point, weight_of_views);
    if (corners.size() < 3) {
      EXPECT_EQ(resolved.lit | resolved.hidden, 0U);
      EXPECT_FALSE(resolved.secondary_known || resolved.around_known);
      EXPECT_EQ(resolved.area_lights_known, 0U);
      EXPECT_EQ(resolved.wanted, ResolvedLight::kAllSamples);
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
    EXPECT_EQ(resolved.lit, lit);
    EXPECT_EQ(resolved.hidden, hidden);
    const double apart = colour_managed ? std::sqrt(high) - std::sqrt(low) : high - low;
    const double limit = double{tolerances_.secondary} * (same_way ? 1.0 : 0.5);
    const double missing = 1.0 - double{grid_.lookup().near} - weight_of_views;
    if (std::abs(apart - limit) > 1e-6 && std::abs(missing) > 1e-6) {
      EXPECT_EQ(resolved.secondary_known, missing < 0.0 && apart < limit);
    }
    if (resolved.secondary_known) {
      EXPECT_NEAR(double{resolved.secondary}, light / sum, 1e-6);
      ++known_;
    }
    if (std::abs(most - least - double{tolerances_.around}) > 1e-6) {
      EXPECT_EQ(resolved.around_known, least >= 0.0 && most - least < double{tolerances_.around});
    }
    if (resolved.around_known) {
      EXPECT_NEAR(double{resolved.around}, around / sum, 1e-6);
    }
    ++resolved_;
    uint8_t wanted = resolved.around_known ? ResolvedLight::kNoSamples : ResolvedLight::kAllSamples;
    for (size_t area_light = 0; area_light < LightRecord::kAreaLights; ++area_light)
      if (!expect_area_light(corners, resolved, area_lights, area_light) &&
          wanted == ResolvedLight::kNoSamples)
        wanted = static_cast<uint8_t>(area_light);
    EXPECT_EQ(resolved.wanted, wanted);
  }

  [[nodiscard]] ResolvedAreaLights area_lights_of(const ResolvedLight& resolved) const {
    return resolved.area_lights_known != 0 ? area_lights_.at(resolved.area_lights)
                                           : ResolvedAreaLights{};
  }

  /// Checks one area light; returns false if rays to the light are needed.
  bool expect_area_light(const std::vector<Corner>& corners, const ResolvedLight& resolved,
                         const ResolvedAreaLights& area_lights, size_t area_light) {
    int low = 255, high = 0, shining = 0;
    double sum = 0.0, weights = 0.0;
    for (const Corner& corner : corners) {
      const uint8_t seen = corner.light.seen[area_light];
      if (seen == KeySamples::Light::kNotShining) continue;
      ++shining;
      low = std::min(low, int{seen});
      high = std::max(high, int{seen});
      sum += corner.weight * seen;
      weights += corner.weight;
    }
    const double apart = static_cast<double>(high - low) / KeySamples::Light::kWholeAreaLight;
    const bool expected = shining >= 2 && apart <= double{tolerances_.seen};
    EXPECT_EQ((resolved.area_lights_known >> area_light & 1) != 0, expected);
    if (expected) {
      ++(high == low ? same_area_lights_ : other_area_lights_);
      EXPECT_NEAR(
          static_cast<double>(area_lights.seen[area_light]) / ResolvedAreaLights::kWholeAreaLight,
          sum / weights / KeySamples::Light::kWholeAreaLight, 1e-4);
      EXPECT_NEAR(
          static_cast<double>(area_lights.apart[area_light]) / ResolvedAreaLights::kWholeAreaLight,
          apart, 1e-4);
    }
    return expected || shining == 0;
  }

  optics::Rig rig_;
  optics::OpticalModel model_;
  RowPlanes planes_;
  KeyGrid grid_;
  KeySamples samples_;
  Tolerances tolerances_ = Tolerances::for_error(2.0);
  std::mt19937_64 random_{3};
  std::vector<ResolvedAreaLights> area_lights_;
  int resolved_ = 0, known_ = 0, same_area_lights_ = 0, other_area_lights_ = 0;
};

TEST_F(ResolvedSamples, AgreeWithTheirCornersIfAllCornersAgree) {
  for (const bool colour_managed : {false, true}) {
    LightResolver resolver(samples_, grid_, tolerances_, colour_managed, kSoft);
    for (int row = 0; row < planes_.rows(); ++row)
      for (int n = 0; n < 300; ++n) {
        const LightResolver::Point point = draw_point(row);
        ResolvedLight resolved;
        resolver.resolve(point, resolved, area_lights_);
        expect_resolved(point, resolved, area_lights_of(resolved), colour_managed);
      }
  }
  EXPECT_GT(resolved_, 10000);
  EXPECT_GT(known_, 500);
  EXPECT_GT(resolved_ - known_, 500);
  EXPECT_GT(same_area_lights_, 500);
  EXPECT_GT(other_area_lights_, 500);
}

/// Cells are cached by row and surface, independently of earlier lookups.
TEST_F(ResolvedSamples, DoNotDependOnEarlierLookups) {
  LightResolver used(samples_, grid_, tolerances_, false, kSoft);
  for (int n = 0; n < 3000; ++n) {
    const auto row = static_cast<int>(random_() % static_cast<uint64_t>(planes_.rows()));
    const LightResolver::Point point = draw_point(row);
    LightResolver fresh(samples_, grid_, tolerances_, false, kSoft);
    ResolvedLight once, again;
    used.resolve(point, once, area_lights_);
    fresh.resolve(point, again, area_lights_);
    ASSERT_EQ(once.lit, again.lit);
    ASSERT_EQ(once.hidden, again.hidden);
    ASSERT_EQ(once.secondary_known, again.secondary_known);
    ASSERT_EQ(once.secondary, again.secondary);
    ASSERT_EQ(once.around_known, again.around_known);
    ASSERT_EQ(once.around, again.around);
    ASSERT_EQ(once.wanted, again.wanted);
    ASSERT_EQ(once.area_lights_known, again.area_lights_known);
    ASSERT_EQ(area_lights_of(once).seen, area_lights_of(again).seen);
    ASSERT_EQ(area_lights_of(once).apart, area_lights_of(again).apart);
  }
}

/// If occlusion is not sampled, no caller requests it.
TEST_F(ResolvedSamples, SkipUnrequestedLight) {
  LightResolver resolver(samples_, grid_, tolerances_, false, {});
  for (int n = 0; n < 500; ++n) {
    ResolvedLight resolved;
    resolver.resolve(draw_point(7), resolved, area_lights_);
    EXPECT_FALSE(resolved.around_known);
    EXPECT_EQ(resolved.area_lights_known, 0U);
    EXPECT_EQ(resolved.wanted, ResolvedLight::kNoSamples);
  }
  EXPECT_TRUE(area_lights_.empty());
}

}  // namespace
}  // namespace lenticule::render
