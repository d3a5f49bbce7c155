// SPDX-License-Identifier: Apache-2.0
// Tests fringes made by formula, with the steps that a lens sheet adds.
#include "calib/measure/fringe_phase.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace lenticule::calib {
namespace {

constexpr int kWidth = 480;
constexpr int kHeight = 270;

optics::Panel panel_4k() {
  optics::Panel panel;
  panel.width_px = 3840;
  panel.height_px = 2160;
  panel.pixel_width = panel.pixel_height = Millimetres(0.1557);
  return panel;
}

/// A camera of 480 x 270 pixels that sees the panel upright, 8 panel pixels per camera pixel.
class FringeStage {
 public:
  explicit FringeStage(const LinearPhase& ground_truth, double bend = 0.0)
      : ground_truth_(ground_truth), bend_(bend) {
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x) {
        pixels_.push_back(static_cast<uint32_t>(y * kWidth + x));
        points_.push_back({8.0 * (x + 0.5), 8.0 * (y + 0.5)});
      }
    std::vector<Sighting> sightings;
    for (size_t n = 0; n < pixels_.size(); n += 97)
      sightings.push_back(
          {.camera_px = {points_[n].x / 8.0, points_[n].y / 8.0}, .panel_px = points_[n]});
    map_ = PanelMap::fit(sightings);
  }

  [[nodiscard]] double phase_at(Vec2 p) const {
    const double u = p.x / 3840.0 - 0.5, v = p.y / 2160.0 - 0.5;
    return ground_truth_.at(p, panel_) + bend_ * std::cos(7.0 * u) * std::cos(5.0 * v + 1.0);
  }

  void show(const Fringe& fringe, double noise) {
    fringe_ = fringe;
    waves_.clear();
    std::mt19937 random(11);
    std::normal_distribution<double> normal(0.0, noise);
    for (const Vec2 p : points_) {
      const double s = 3.0 * ((p.x - 1920.0) + fringe.slant * (p.y - 1080.0));
      const double turns = s / fringe.pitch_subpx - phase_at(p);
      const auto wave = std::polar(0.3, 2.0 * std::numbers::pi * turns);
      waves_.emplace_back(static_cast<float>(wave.real() + 0.3 * normal(random)),
                          static_cast<float>(wave.imag() + 0.3 * normal(random)));
    }
  }

  [[nodiscard]] FringeView view() const { return {fringe_, waves_, points_}; }
  [[nodiscard]] std::optional<FringePeak> find(const LinearPhase& start, double most) const {
    return find_fringes(view(), start, most, panel_);
  }
  [[nodiscard]] BlockGrid blocks(const LinearPhase& model) const {
    return average_blocks(view(), pixels_, kWidth, kHeight, 10, *map_, model, panel_);
  }
  [[nodiscard]] const optics::Panel& panel() const { return panel_; }

 private:
  optics::Panel panel_ = panel_4k();
  LinearPhase ground_truth_;
  double bend_;
  Fringe fringe_;
  std::vector<uint32_t> pixels_;
  std::vector<Vec2> points_;
  std::vector<Complex> waves_;
  std::optional<PanelMap> map_;
};

LinearPhase phase_of(double pitch, double slant, double constant) {
  return {.constant = constant, .per_px_x = 3.0 / pitch, .per_px_y = 3.0 * slant / pitch};
}

TEST(FringePhase, RefinesAStartThatIsTenPercentOff) {
  const LinearPhase ground_truth = phase_of(7.70123, 0.2521, 0.3);
  FringeStage stage(ground_truth, 0.1);
  for (const double off : {0.92, 1.09}) {
    const Fringe fringe{.pitch_subpx = 7.70123 * off, .slant = 0.24, .phase = 0.0};
    stage.show(fringe, 0.3);
    const LinearPhase start = phase_of(fringe.pitch_subpx, fringe.slant, 0.0);
    const std::optional<FringePeak> peak = stage.find(start, 220.0);
    ASSERT_TRUE(peak);
    EXPECT_GT(peak->height, 2.0 * peak->second);
    LinearPhase line = peak->phase;
    for (int round = 0; round < 2; ++round) {
      const std::optional<LinearPhase> next = fit_linear(stage.blocks(line), stage.panel());
      ASSERT_TRUE(next);
      line = *next;
    }
    EXPECT_NEAR(line.pitch_subpx() / 7.70123, 1.0, 2e-5);
    EXPECT_NEAR(line.slant(), 0.2521, 5e-5);
  }
}

TEST(FringePhase, BlocksGiveThePhaseWithRealisticErrors) {
  const LinearPhase ground_truth = phase_of(7.70123, 0.2521, 0.3);
  FringeStage stage(ground_truth, 0.1);
  stage.show({.pitch_subpx = 7.72, .slant = 0.2521, .phase = 0.0}, 0.4);
  const BlockGrid grid = stage.blocks(ground_truth);
  double squares = 0.0;
  int count = 0;
  for (const PhaseBlock& block : grid.blocks) {
    ASSERT_GT(block.pixels, 0);
    const double off = block.phase - stage.phase_at(block.panel_px);
    ASSERT_LT(std::abs(off), 0.05);
    squares += off * off / (block.sigma * block.sigma);
    ++count;
  }
  EXPECT_NEAR(std::sqrt(squares / count), 1.0, 0.15);
}

TEST(FringePhase, WholeLensesContinueFromBlockToBlock) {
  // Seven fringes off the model: phases of more than a lens must not jump.
  const LinearPhase ground_truth = phase_of(7.70123, 0.2521, 0.0);
  FringeStage stage(ground_truth);
  stage.show({.pitch_subpx = 7.70123, .slant = 0.2521, .phase = 0.0}, 0.1);
  LinearPhase model = ground_truth;
  model.per_px_x += 7.0 / 3840.0;
  const BlockGrid grid = stage.blocks(model);
  const double first = grid.blocks[0].phase - stage.phase_at(grid.blocks[0].panel_px);
  for (const PhaseBlock& block : grid.blocks)
    ASSERT_NEAR(block.phase - stage.phase_at(block.panel_px), first, 0.05);
}

TEST(FringePhase, FindsNoFringesWithoutLight) {
  FringeStage stage(phase_of(7.7, 0.25, 0.0));
  const std::vector<Complex> dark(kWidth * kHeight);
  const std::vector<Vec2> points(kWidth * kHeight);
  EXPECT_FALSE(find_fringes({{.pitch_subpx = 7.7}, dark, points}, phase_of(7.7, 0.25, 0.0), 100.0,
                            stage.panel()));
}

}  // namespace
}  // namespace lenticule::calib
