// SPDX-License-Identifier: Apache-2.0
// Tests the choice of the tolerated error on a simulated renderer, whose frames take less time with
// a larger error.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "apps/lenticule-tools/offline/film_renderer.h"
#include "base/error.h"

namespace lenticule::tools {
namespace {

/// SimulatedRenderer takes `seconds` at an error of 1, and error^-slope times that at others, give
/// or take the noise.
class SimulatedRenderer {
 public:
  SimulatedRenderer(double slope, double noise = 0.0) : slope_(slope), noise_(noise) {}

  /// Renders frames under the controller; returns the error of each.
  std::vector<double> run(ErrorController& controller, int frames, double seconds) {
    std::vector<double> errors;
    for (int n = 0; n < frames; ++n) {
      errors.push_back(controller.error());
      last_s_ = seconds * std::pow(errors.back(), -slope_) * (1.0 + noise_ * spread_(random_));
      controller.add_frame(last_s_);
    }
    return errors;
  }
  [[nodiscard]] double last_rate() const { return 1.0 / last_s_; }

 private:
  double slope_;
  double noise_;
  double last_s_ = 0.0;
  std::mt19937 random_{7};
  std::uniform_real_distribution<double> spread_{-1.0, 1.0};
};

/// Returns how often the error turns from rising to falling or back.
int turns(const std::vector<double>& errors) {
  int count = 0;
  double direction = 0.0;
  for (size_t n = 1; n < errors.size(); ++n) {
    const double step = errors[n] - errors[n - 1];
    if (step * direction < 0.0) ++count;
    if (step != 0.0) direction = step;
  }
  return count;
}

class ErrorControllerSlopes : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(All, ErrorControllerSlopes, ::testing::Values(0.15, 0.3, 0.5, 0.8, 1.0));

TEST_P(ErrorControllerSlopes, ReachesTheRateAndKeepsTheErrorThen) {
  // An error of 6 holds ten frames a second.
  const double seconds = 0.095 * std::pow(6.0, GetParam());
  SimulatedRenderer renderer(GetParam());
  ErrorController controller(10.0);
  const std::vector<double> errors = renderer.run(controller, 90, seconds);
  EXPECT_GE(renderer.last_rate(), 9.9);
  EXPECT_LE(renderer.last_rate(), 11.2);
  EXPECT_LE(turns(errors), 1);
  const std::vector<double> later = renderer.run(controller, 300, seconds);
  EXPECT_EQ(std::ranges::count(later, later.front()), 300);
}

TEST_P(ErrorControllerSlopes, FollowsASceneThatBecomesHeavierAndLighter) {
  const double seconds = 0.095 * std::pow(2.0, GetParam());
  SimulatedRenderer renderer(GetParam());
  ErrorController controller(10.0);
  (void)renderer.run(controller, 30, seconds);
  const double heavier = std::pow(4.0, GetParam());  // needs four times the error
  const std::vector<double> up = renderer.run(controller, 120, heavier * seconds);
  EXPECT_GE(renderer.last_rate(), 9.9);
  EXPECT_LE(turns(up), 2);
  const std::vector<double> down = renderer.run(controller, 120, seconds);
  EXPECT_LE(renderer.last_rate(), 11.2);
  EXPECT_LE(turns(down), 2);
}

TEST(ErrorController, StaysWithinItsRangeWhenTheRateIsOutOfReach) {
  SimulatedRenderer renderer(0.3);
  ErrorController controller(10.0);
  for (const double error : renderer.run(controller, 90, 10.0))
    EXPECT_LE(error, ErrorController::kMostError);
  EXPECT_DOUBLE_EQ(controller.error(), ErrorController::kMostError);
  for (const double error : renderer.run(controller, 90, 0.001))
    EXPECT_GE(error, ErrorController::kLeastError);
  EXPECT_DOUBLE_EQ(controller.error(), ErrorController::kLeastError);
}

TEST(ErrorController, LeavesItsLimitAtOnce) {
  SimulatedRenderer renderer(0.5);
  ErrorController controller(10.0);
  (void)renderer.run(controller, 600, 10.0);
  const std::vector<double> errors = renderer.run(controller, 9, 0.05);
  EXPECT_LT(errors.back(), ErrorController::kMostError / 2.0);
}

TEST(ErrorController, IsSteadyAlthoughFramesTakeDifferentTimes) {
  const double seconds = 0.095 * std::pow(4.0, 0.3);  // an error of 4
  SimulatedRenderer renderer(0.3, 0.1);
  ErrorController controller(10.0);
  (void)renderer.run(controller, 90, seconds);
  for (const double error : renderer.run(controller, 2000, seconds)) {
    EXPECT_GT(error, 2.0);
    EXPECT_LT(error, 8.0);
  }
}

TEST(ErrorController, IgnoresASingleSlowFrame) {
  ErrorController controller(10.0);
  for (int n = 0; n < 300; ++n) controller.add_frame(n % 3 == 1 ? 5.0 : 0.095);
  EXPECT_DOUBLE_EQ(controller.error(), ErrorController::kFirstError);
}

TEST(ErrorController, RefusesRatesThatNoRendererHas) {
  for (const double rate : {0.0, -1.0, 1e6, std::nan("")})
    EXPECT_THROW(ErrorController{rate}, Error) << rate;
}

}  // namespace
}  // namespace lenticule::tools
