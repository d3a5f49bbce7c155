// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "calib/measure/viewpoint.h"

namespace lenticule::calib {
namespace {

/// Returns pictures of a camera whose channels overlap a little, behind a lossless link.
LinkPictures whole_link(int channels) {
  LinkPictures pictures{.camera_channels = channels};
  pictures.flat = {{{0.20, 0.02, 0.00}, {0.03, 0.30, 0.03}, {0.00, 0.04, 0.10}}};
  for (size_t d = 0; d < 3; ++d)
    for (size_t c = 0; c < 3; ++c) {
      pictures.columns[d][c] = 0.5 * pictures.flat[d][c];
      pictures.white[c] += pictures.flat[d][c];
    }
  for (size_t c = 0; c < 3; ++c) pictures.checks[c] = 0.5 * pictures.white[c];
  return pictures;
}

TEST(LinkCheck, AcceptsALinkWithFullChroma) {
  for (const int channels : {1, 3}) {
    const LinkCheck check = check_link(whole_link(channels));
    EXPECT_FALSE(check.chroma_subsampled);
    EXPECT_FALSE(check.scaled);
    EXPECT_TRUE(check.findings.empty());
    EXPECT_LT(check.chroma_leak, 1e-9);
  }
}

TEST(LinkCheck, ReportsLeakingColoursAsSubsampledChroma) {
  LinkPictures pictures = whole_link(3);
  for (size_t c = 0; c < 3; ++c) pictures.columns[0][c] += 0.1 * pictures.flat[1][c];
  const LinkCheck check = check_link(pictures);
  EXPECT_TRUE(check.chroma_subsampled);
  EXPECT_NEAR(check.chroma_leak, 0.2, 1e-9);
  ASSERT_EQ(check.findings.size(), 1U);
  EXPECT_NE(check.findings[0].find("4:4:4"), std::string::npos);
}

TEST(LinkCheck, ReportsDarkCheckerboardsAsScaling) {
  LinkPictures pictures = whole_link(3);
  for (double& light : pictures.checks) light *= 0.6;
  const LinkCheck check = check_link(pictures);
  EXPECT_TRUE(check.scaled);
  EXPECT_FALSE(check.chroma_subsampled);
}

TEST(LinkCheck, WeightsFollowTheResponse) {
  const LinkPictures pictures = whole_link(3);
  const ChannelWeights green = weights_for(pictures, 1);
  EXPECT_NEAR(green[0] + green[1] + green[2], 1.0, 1e-6);
  EXPECT_NEAR(green[1] / green[0], 10.0, 1e-4);
  EXPECT_EQ(weights_for(whole_link(1), 1), kEqualWeights);
}

}  // namespace
}  // namespace lenticule::calib
