// SPDX-License-Identifier: Apache-2.0
#include "frames/weaving/crosstalk.h"

#include <gtest/gtest.h>

#include <cmath>

#include "frames/srgb.h"
#include "tests/support/error_matchers.h"

namespace lenticule::frames {
namespace {

using test::error_of;

/// Returns the linear light that an eye in the middle of view `eye` sees, by the definition.
double seen(const ViewSet& views, const Crosstalk& crosstalk, int eye, int channel) {
  double light = 0.0, sum = 0.0;
  for (int view = 0; view < views.count(); ++view) {
    const auto apart = static_cast<size_t>(std::abs(view - eye));
    if (apart >= crosstalk.shares.size()) continue;
    light += crosstalk.shares[apart] * linear_of_codes()[views.pixel(view, 0, 0)[channel]];
    sum += crosstalk.shares[apart];
  }
  return light / sum;
}

ViewSet grey_views(const std::vector<int>& codes) {
  std::vector<WovenFrame> views;
  for (const int code : codes) {
    views.emplace_back(FrameGeometry{.width = 1, .height = 1});
    for (uint8_t& byte : views.back().bytes()) byte = static_cast<uint8_t>(code);
  }
  return ViewSet(std::move(views));
}

double worst_error(const ViewSet& meant, const ViewSet& shown, const Crosstalk& crosstalk) {
  double worst = 0.0;
  for (int eye = 0; eye < meant.count(); ++eye)
    worst = std::max(worst, std::abs(seen(shown, crosstalk, eye, 1) -
                                     linear_of_codes()[meant.pixel(eye, 0, 0)[1]]));
  return worst;
}

TEST(Crosstalk, OfNeighboursIsCancelledWithinThePanelsRange) {
  const ViewSet views = grey_views({120, 140, 130, 150, 145, 120, 135});
  const Crosstalk crosstalk = crosstalk_of_percent(20.0);
  EXPECT_GT(worst_error(views, views, crosstalk), 0.01);
  EXPECT_LT(worst_error(views, compensate(views, crosstalk), crosstalk), 0.0025)
      << "half a code is 0.002 of full light here";
}

TEST(Crosstalk, IsReducedEvenIfClampedAtBlackAndWhite) {
  const ViewSet views = grey_views({0, 0, 255, 255, 0, 0, 0, 255});
  const Crosstalk crosstalk = crosstalk_of_percent(20.0);
  const ViewSet shown = compensate(views, crosstalk);
  EXPECT_EQ(shown.pixel(2, 0, 0)[0], 255);
  EXPECT_EQ(shown.pixel(1, 0, 0)[0], 0);
  EXPECT_LE(worst_error(views, shown, crosstalk), worst_error(views, views, crosstalk));
}

TEST(Crosstalk, OfASpotIsReduced) {
  const ViewSet views = grey_views({60, 70, 90, 120, 160, 120, 90, 70, 60, 60, 90, 120});
  for (const double sigma : {0.5, 0.8, 1.5}) {
    const Crosstalk crosstalk = crosstalk_of_spot(sigma);
    EXPECT_LT(worst_error(views, compensate(views, crosstalk), crosstalk),
              0.6 * worst_error(views, views, crosstalk))
        << sigma;
  }
}

TEST(Crosstalk, NeitherChangesEvenViewsNorMakesNoiseGrowWithoutBound) {
  for (const Crosstalk& crosstalk :
       {crosstalk_of_percent(0.0), crosstalk_of_percent(40.0), crosstalk_of_spot(0.4),
        crosstalk_of_spot(1.8), crosstalk_of_spot(8.0)}) {
    const std::vector<double> matrix = compensation_matrix(crosstalk, 45);
    for (size_t view = 0; view < 45; ++view) {
      double sum = 0.0, squares = 0.0;
      for (size_t other = 0; other < 45; ++other) {
        sum += matrix[view * 45 + other];
        squares += matrix[view * 45 + other] * matrix[view * 45 + other];
      }
      EXPECT_NEAR(sum, 1.0, 1e-9);
      EXPECT_LT(std::sqrt(squares), 5.0);
    }
  }
}

TEST(Crosstalk, RefusesPercentagesOutOfRange) {
  for (const double percent : {-1.0, 41.0, std::nan("")})
    EXPECT_EQ(error_of([&] { (void)crosstalk_of_percent(percent); }).kind(), ErrorKind::Usage);
}

}  // namespace
}  // namespace lenticule::frames
