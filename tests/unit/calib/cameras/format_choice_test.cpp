// SPDX-License-Identifier: Apache-2.0
// Tests the format requested from a driver, and the checks of its answers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/cameras/v4l2_camera.h"
#include "tests/support/error_matchers.h"
#include "tests/support/fakes/fake_v4l2.h"

namespace lenticule::calib {
namespace {

using testing::HasSubstr;

constexpr FrameSize kVga{640, 480};
constexpr FrameSize kHd{1280, 720};
constexpr FrameSize kFullHd{1920, 1080};

class Choosing : public testing::Test {
 protected:
  AgreedFormat agreed(const FormatRequest& request = {}) {
    const std::unique_ptr<V4l2Device> device = stage_.system.open("/dev/video0").device;
    return agree_on_format(*device, stage_.system, "/dev/video0", request);
  }
  Error refusal(const FormatRequest& request = {}) {
    return test::error_of([&] { (void)agreed(request); });
  }
  test::OneCamera stage_;
  test::FakeCamera& camera_ = stage_.camera;
};

TEST_F(Choosing, PrefersRawToSharedChromaToCompressed) {
  const uint32_t in_order[] = {V4L2_PIX_FMT_GREY,  V4L2_PIX_FMT_Y16,  V4L2_PIX_FMT_SGRBG8,
                               V4L2_PIX_FMT_YUYV,  V4L2_PIX_FMT_NV12, V4L2_PIX_FMT_RGB24,
                               V4L2_PIX_FMT_BGR24, V4L2_PIX_FMT_MJPEG};
  camera_.formats.clear();
  for (const uint32_t fourcc : in_order)
    camera_.formats.insert(camera_.formats.begin(), {fourcc, {kFullHd}});
  for (const uint32_t fourcc : in_order) {
    EXPECT_EQ(fourcc_name(agreed().raw.fourcc), fourcc_name(fourcc));
    camera_.formats.pop_back();
  }
}

TEST_F(Choosing, TinyPicturesComeLast) {
  camera_.formats = {{V4L2_PIX_FMT_GREY, {{340, 340}}},
                     {V4L2_PIX_FMT_YUYV, {kVga}},
                     {V4L2_PIX_FMT_MJPEG, {kVga, kFullHd}}};
  EXPECT_EQ(fourcc_name(agreed().raw.fourcc), "MJPG");
  EXPECT_EQ(fourcc_name(agreed({.width = 640, .height = 480}).raw.fourcc), "YUYV");
  EXPECT_EQ(fourcc_name(agreed({.pixel_format = "GREY"}).raw.fourcc), "GREY");
}

TEST_F(Choosing, TheNearestSizeIsTaken) {
  camera_.formats = {{V4L2_PIX_FMT_YUYV, {kVga, kHd, kFullHd}}};
  EXPECT_EQ(agreed({.width = 1300, .height = 700}).raw.width, 1280);
  EXPECT_EQ(agreed({.width = 4000, .height = 3000}).raw.width, 1920);
  EXPECT_EQ(agreed().raw.width, 1920);
}

TEST_F(Choosing, WithoutAListOfSizesTheDriverDecides) {
  camera_.formats = {{V4L2_PIX_FMT_YUYV, {kHd}}};
  camera_.errors[VIDIOC_ENUM_FRAMESIZES] = {ENOTTY, ENOTTY};
  EXPECT_EQ(agreed().raw.width, 1280);
}

TEST_F(Choosing, UsesTheValuesReadBack) {
  camera_.formats = {{V4L2_PIX_FMT_YUYV, {kHd}}};
  camera_.adjust = [](v4l2_pix_format& pix) {
    pix.width = 1024;
    pix.height = 500;
    pix.bytesperline = 4096;
    pix.colorspace = V4L2_COLORSPACE_REC709;
    pix.quantization = V4L2_QUANTIZATION_FULL_RANGE;
    pix.ycbcr_enc = V4L2_YCBCR_ENC_709;
    pix.xfer_func = V4L2_XFER_FUNC_SRGB;
  };
  const RawFormat raw = agreed().raw;
  EXPECT_EQ(raw.width, 1024);
  EXPECT_EQ(raw.height, 500);
  EXPECT_EQ(raw.bytes_per_line, 4096U);
  EXPECT_EQ(raw.coding.colorspace, V4L2_COLORSPACE_REC709);
  EXPECT_EQ(raw.coding.quantization, V4L2_QUANTIZATION_FULL_RANGE);
  EXPECT_EQ(raw.coding.ycbcr_enc, V4L2_YCBCR_ENC_709);
  EXPECT_EQ(raw.coding.xfer_func, V4L2_XFER_FUNC_SRGB);
}

TEST_F(Choosing, IgnoresFieldsUnknownToAnOldDriver) {
  camera_.adjust = [](v4l2_pix_format& pix) {
    pix.priv = 0;
    pix.quantization = 77;
  };
  EXPECT_EQ(agreed().raw.coding.quantization, 0U);
}

TEST_F(Choosing, DetectsAFormatReplacedByTheDriver) {
  camera_.formats = {{V4L2_PIX_FMT_GREY, {kHd}}, {V4L2_PIX_FMT_MJPEG, {kHd}}};
  camera_.adjust = [](v4l2_pix_format& pix) {
    if (pix.pixelformat == V4L2_PIX_FMT_GREY) pix.pixelformat = v4l2_fourcc('H', '2', '6', '4');
  };
  EXPECT_EQ(fourcc_name(agreed().raw.fourcc), "MJPG");
}

TEST_F(Choosing, ReportsTheActualFrameRate) {
  camera_.interval = {1001, 15000};
  EXPECT_NEAR(agreed().frames_per_second, 14.985, 1e-3);
  camera_.interval = {0, 30};
  EXPECT_EQ(agreed().frames_per_second, 0.0);
  camera_.reports_rate = false;
  EXPECT_EQ(agreed().frames_per_second, 0.0);
  camera_.errors[VIDIOC_S_PARM] = {ENOTTY};
  EXPECT_EQ(agreed().frames_per_second, 0.0);
}

TEST_F(Choosing, InputsFollowTheirSignal) {
  camera_.signal_error = 0;
  (void)agreed();
  EXPECT_EQ(camera_.log.front(), "S_DV_TIMINGS") << "before the format, which depends on it";
  camera_.signal_error = ENOLINK;
  test::expect_error(refusal(), ErrorKind::Device, "/dev/video0: no usable signal");
}

TEST_F(Choosing, RefusesInterlacedPictures) {
  camera_.adjust = [](v4l2_pix_format& pix) { pix.field = V4L2_FIELD_INTERLACED; };
  EXPECT_THAT(refusal().what(), HasSubstr("interlaced"));
}

TEST_F(Choosing, RefusesWithAListOfAvailableFormats) {
  camera_.formats = {{v4l2_fourcc('H', '2', '6', '4'), {kHd}},
                     {v4l2_fourcc('H', 'E', 'V', 'C'), {kHd}}};
  EXPECT_THAT(refusal().what(), HasSubstr("no known pixel format among H264, HEVC"));
  camera_.formats = {{V4L2_PIX_FMT_YUYV, {kHd}}};
  EXPECT_THAT(refusal({.pixel_format = "GREY"}).what(), HasSubstr("no GREY among YUYV"));
  camera_.formats.clear();
  EXPECT_THAT(refusal().what(), HasSubstr("among nothing"));
}

TEST_F(Choosing, ABusyCameraIsNamedWithItsUser) {
  stage_.system.holder = "cheese (4711)";
  camera_.errors[VIDIOC_S_FMT] = {EBUSY};
  const Error error = refusal();
  EXPECT_EQ(error.kind(), ErrorKind::Device);
  EXPECT_STREQ(error.what(), "/dev/video0: cannot set the format: in use by another program");
  EXPECT_THAT(error.hint(), HasSubstr("cheese (4711)"));
}

TEST_F(Choosing, AbsurdSizesDoNotOverflow) {
  camera_.formats = {{V4L2_PIX_FMT_YUYV, {{-1, -1}, {0, 0}}}};
  camera_.adjust = [](v4l2_pix_format& pix) { pix.width = 0xFFFFFFFFU; };
  EXPECT_EQ(agreed().raw.width, 0) << "which the unpacker refuses";
}

}  // namespace
}  // namespace lenticule::calib
