// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "calib/photo/single_photo.h"

namespace lenticule::calib {
namespace {

/// Returns the blocks of a plane that is off by `error`, with a position error of `shift` fringes
/// that varies over the panel.
std::vector<FringeBlock> blocks_of(const LensPlane& error, double shift, double noise,
                                   uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> scatter(0.0, 1.0);
  std::vector<FringeBlock> blocks;
  for (int r = 0; r < 16; ++r) {
    for (int c = 0; c < 24; ++c) {
      FringeBlock b;
      b.block = static_cast<uint32_t>(24 * r + c);
      b.detuning = r / 2 % 2 == 0 ? 1.0 : -1.0;
      b.x = (c + 0.5) / 24.0 - 0.5;
      b.y = (r + 0.5) / 16.0 - 0.5;
      const double cycles = -(error.at + error.across * b.x + error.down * b.y) +
                            b.detuning * shift * (1.0 + b.x - 2.0 * b.x * b.y * b.y) +
                            noise * scatter(random);
      b.phase = cycles - std::round(cycles);
      b.contrast = 0.5;
      b.weight = 100.0;
      blocks.push_back(b);
    }
  }
  return blocks;
}

TEST(PhasePlane, SeparatesPitchFromPositionErrors) {
  const LensPlane ground_truth{0.07, -0.11, 0.05};
  const PlaneCorrection found = fit_plane(blocks_of(ground_truth, 0.1, 0.0, 1));
  EXPECT_NEAR(found.add.at, ground_truth.at, 1e-5);
  EXPECT_NEAR(found.add.across, ground_truth.across, 1e-5);
  EXPECT_NEAR(found.add.down, ground_truth.down, 1e-5);
  EXPECT_EQ(found.used, 384);
}

TEST(PhasePlane, ToleratesOneOutlierInTenBlocks) {
  const LensPlane ground_truth{0.02, 0.03, -0.04};
  std::vector<FringeBlock> blocks = blocks_of(ground_truth, 0.01, 0.002, 2);
  for (size_t i = 0; i < blocks.size(); i += 10) blocks[i].phase = 0.4;
  const PlaneCorrection found = fit_plane(blocks);
  EXPECT_NEAR(found.add.across, ground_truth.across, 0.004);
  EXPECT_LE(found.used, 346);
  EXPECT_GT(found.used, 320);
  EXPECT_NEAR(found.rms_lenses, 0.002, 0.0004);
}

// The standard errors agree with the scatter of many runs.
TEST(PhasePlane, ItsStandardErrorsAgreeWithTheScatter) {
  double squares = 0.0, predicted = 0.0;
  constexpr int kTries = 60;
  for (int i = 0; i < kTries; ++i) {
    const PlaneCorrection found =
        fit_plane(blocks_of({}, 0.0, 0.004, 100 + static_cast<uint32_t>(i)));
    squares += found.add.across * found.add.across / kTries;
    predicted += found.covariance[4] / kTries;
  }
  EXPECT_NEAR(std::sqrt(squares / predicted), 1.0, 0.3);
}

TEST(PhasePlane, SearchesUpToOneAndAHalfFringes) {
  const LensPlane ground_truth{0.3, 1.33, -1.21};
  const LensPlane found = search_plane(blocks_of(ground_truth, 0.02, 0.01, 3));
  EXPECT_NEAR(found.across, ground_truth.across, 0.08);
  EXPECT_NEAR(found.down, ground_truth.down, 0.08);
}

// With the offset left to the fit, which sees phases without whole cycles, blocks at half a lens
// would go to both sides.
TEST(PhasePlane, FindsOffsetsOfHalfALens) {
  for (const double offset : {-0.5, -0.48, 0.0, 0.26, 0.49}) {
    const LensPlane ground_truth{offset, 0.4, -0.3};
    const LensPlane found = search_plane(blocks_of(ground_truth, 0.05, 0.01, 4));
    const double off = found.at - ground_truth.at;
    EXPECT_NEAR(off - std::round(off), 0.0, 0.03) << offset;
  }
}

TEST(PhasePlane, RefusesTooFewBlocks) {
  std::vector<FringeBlock> blocks = blocks_of({0.1, 0.1, 0.1}, 0.0, 0.0, 1);
  blocks.resize(19);
  const PlaneCorrection found = fit_plane(blocks);
  EXPECT_EQ(found.used, 0);
  EXPECT_EQ(found.add.across, 0.0);
}

}  // namespace
}  // namespace lenticule::calib
