// SPDX-License-Identifier: Apache-2.0
// Tests which nodes are cameras, and which camera a name selects.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/cameras/v4l2_camera.h"
#include "tests/support/error_matchers.h"
#include "tests/support/fakes/fake_v4l2.h"

namespace lenticule::calib {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class Listing : public testing::Test {
 protected:
  Listing() {
    metadata_.device_caps = V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING;
    first_.formats = {{V4L2_PIX_FMT_YUYV, {{640, 480}, {1280, 720}}},
                      {v4l2_fourcc('H', '2', '6', '4'), {{1920, 1080}}}};
    system_.entries = {{{"/dev/video0", "/dev/v4l/by-id/usb-First-index0"}, &first_},
                       {{"/dev/video1", "/dev/v4l/by-id/usb-First-index1"}, &metadata_},
                       {{"/dev/video2", ""}, &second_}};
  }
  test::FakeCamera first_;
  test::FakeCamera metadata_;
  test::FakeCamera second_;
  test::FakeSystem system_;
};

TEST_F(Listing, SkipsNodesThatAreNotCameras) {
  const std::vector<CameraListing> cameras = list_cameras(system_);
  ASSERT_EQ(cameras.size(), 2U);
  EXPECT_EQ(cameras[0].path, "/dev/video0");
  EXPECT_EQ(cameras[0].name, "Fake Camera");
  EXPECT_EQ(cameras[0].bus, "usb-1.2");
  EXPECT_EQ(cameras[1].path, "/dev/video2");
  EXPECT_EQ(first_.open_count, 0);
}

TEST_F(Listing, NamesFormatsAndSizes) {
  const std::vector<FormatOffer> formats = list_cameras(system_).at(0).formats;
  ASSERT_EQ(formats.size(), 2U);
  EXPECT_EQ(formats[0].pixel_format(), "YUYV");
  EXPECT_TRUE(formats[0].usable());
  EXPECT_THAT(formats[0].size_names(), ElementsAre("640x480", "1280x720"));
  EXPECT_EQ(formats[1].pixel_format(), "H264");
  EXPECT_FALSE(formats[1].usable());
}

TEST_F(Listing, ReportsWhyACameraCannotBeQueried) {
  system_.entries[2].open_error = EACCES;
  const std::vector<CameraListing> cameras = list_cameras(system_);
  ASSERT_EQ(cameras.size(), 2U);
  EXPECT_THAT(cameras[0].problem, IsEmpty());
  EXPECT_THAT(cameras[1].problem, HasSubstr("permission denied"));
  EXPECT_THAT(cameras[1].problem, HasSubstr("usermod -aG video"));
}

TEST_F(Listing, FindsByPathNumberAndIdentity) {
  EXPECT_EQ(find_camera(system_, "/dev/video2").path, "/dev/video2");
  EXPECT_EQ(find_camera(system_, "video2").path, "/dev/video2");
  EXPECT_EQ(find_camera(system_, "usb-First-index0").path, "/dev/video0");
  EXPECT_EQ(find_camera(system_, "/dev/v4l/by-id/usb-First-index0").path, "/dev/video0");
  EXPECT_EQ(find_camera(system_, "/somewhere/else").path, "/somewhere/else");
}

TEST_F(Listing, RefusesAnUnknownName) {
  test::expect_error(test::error_of([&] { (void)find_camera(system_, "usb-Nobody"); }),
                     ErrorKind::Device, "none is called 'usb-Nobody'");
}

TEST_F(Listing, WithoutANameExactlyOneCameraMustExist) {
  test::expect_error(test::error_of([&] { (void)find_camera(system_, ""); }), ErrorKind::Usage,
                     "/dev/v4l/by-id/usb-First-index0, /dev/video2");
  system_.entries.pop_back();
  EXPECT_EQ(find_camera(system_, "").path, "/dev/video0");
  system_.entries.clear();
  test::expect_error(test::error_of([&] { (void)find_camera(system_, ""); }), ErrorKind::Device);
}

TEST(RealSystem, WorksWithoutACamera) {
  V4l2System& system = linux_v4l2();
  (void)system.nodes();
  EXPECT_EQ(system.open("/dev/video-that-is-not").error, ENOENT);
  EXPECT_EQ(system.open("/").error, ENOTTY) << "no character device";
  EXPECT_FALSE(system.group("/dev/null").empty());
}

TEST(RealSystem, RefusesADeviceThatIsNotACamera) {
  V4l2Options options;
  options.device = "/dev/null";
  test::expect_error(test::error_of([&] { (void)open_v4l2_camera(options); }), ErrorKind::Device,
                     "/dev/null: cannot open it: not a video device");
}

}  // namespace
}  // namespace lenticule::calib
