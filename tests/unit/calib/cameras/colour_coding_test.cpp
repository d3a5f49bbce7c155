// SPDX-License-Identifier: Apache-2.0
// Tests V4L2's defaults for properties that drivers leave open, and the formulas of the standards.
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <cmath>

#include "calib/cameras/pixel_unpack.h"

namespace lenticule::calib {
namespace {

TEST(ColourRules, AWebcamWithoutStatementsIsSrgbIn601) {
  const ColourCoding coding = resolved({}, Samples::Ycbcr);
  EXPECT_EQ(coding.colorspace, V4L2_COLORSPACE_SRGB);
  EXPECT_EQ(coding.ycbcr_enc, V4L2_YCBCR_ENC_601);
  EXPECT_EQ(coding.quantization, V4L2_QUANTIZATION_LIM_RANGE);
  EXPECT_EQ(coding.xfer_func, V4L2_XFER_FUNC_SRGB);
}

TEST(ColourRules, RgbIsFullRange) {
  EXPECT_EQ(resolved({}, Samples::Rgb).quantization, V4L2_QUANTIZATION_FULL_RANGE);
  ColourCoding coding;
  coding.quantization =
      V4L2_QUANTIZATION_LIM_RANGE;  // unless the driver states otherwise, as for HDMI
  EXPECT_EQ(resolved(coding, Samples::Rgb).quantization, V4L2_QUANTIZATION_LIM_RANGE);
}

TEST(ColourRules, FollowTheColourSpace) {
  ColourCoding hdtv;
  hdtv.colorspace = V4L2_COLORSPACE_REC709;
  EXPECT_EQ(resolved(hdtv, Samples::Ycbcr).ycbcr_enc, V4L2_YCBCR_ENC_709);
  EXPECT_EQ(resolved(hdtv, Samples::Ycbcr).xfer_func, V4L2_XFER_FUNC_709);
  ColourCoding jpeg;
  jpeg.colorspace = V4L2_COLORSPACE_JPEG;
  EXPECT_EQ(resolved(jpeg, Samples::Ycbcr).quantization, V4L2_QUANTIZATION_FULL_RANGE);
  ColourCoding raw;
  raw.colorspace = V4L2_COLORSPACE_RAW;
  EXPECT_EQ(resolved(raw, Samples::Ycbcr).quantization, V4L2_QUANTIZATION_FULL_RANGE);
  EXPECT_EQ(resolved(raw, Samples::Rgb).xfer_func, V4L2_XFER_FUNC_NONE);
}

struct Point {
  uint32_t curve;
  double encoded;
  double linear;
};

// The points come from the inverse formulas of the standards, computed by hand.
TEST(Transfer, PassesKnownPoints) {
  const Point points[] = {
      {V4L2_XFER_FUNC_NONE, 0.5, 0.5},
      {V4L2_XFER_FUNC_SRGB, 0.5, 0.214041},
      {V4L2_XFER_FUNC_709, 0.5, 0.259589},
      {V4L2_XFER_FUNC_709, 0.0405, 0.009},
      {V4L2_XFER_FUNC_SMPTE240M, 0.04, 0.01},
      {V4L2_XFER_FUNC_SMPTE240M, 1.1115 * std::pow(0.5, 0.45) - 0.1115, 0.5},
      {V4L2_XFER_FUNC_OPRGB, 0.5, 0.217756},
      {V4L2_XFER_FUNC_DCI_P3, 0.5, 0.164938},
      {V4L2_XFER_FUNC_SMPTE2084, 0.508078, 0.01},  // 100 cd/m2
  };
  for (const Point& point : points)
    EXPECT_NEAR(linear_by_formula(point.curve, point.encoded), point.linear, 2e-6)
        << point.curve << " at " << point.encoded;
}

TEST(Transfer, TheTableAgreesWithTheFormula) {
  const double allowed = 3e-5;  // BT.709's linear part does not quite meet its power function
  for (uint32_t number = V4L2_XFER_FUNC_709; number <= V4L2_XFER_FUNC_SMPTE2084; ++number) {
    const TransferCurve curve(number);
    for (int i = 0; i <= 9973; ++i)
      ASSERT_NEAR(curve(static_cast<float>(i) / 9973.0F), linear_by_formula(number, i / 9973.0),
                  allowed)
          << number << " at " << i;
    EXPECT_EQ(curve(-3.0F), curve(0.0F));
    EXPECT_EQ(curve(2.0F), curve(1.0F));
    EXPECT_EQ(curve(NAN), curve(0.0F));
  }
}

}  // namespace
}  // namespace lenticule::calib
