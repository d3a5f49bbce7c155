// SPDX-License-Identifier: Apache-2.0
// Opens cameras of the kernel's V4L2: USB webcams, capture cards. Data flow: the driver's buffer,
// V4L2's colour rules, linear light. libv4l is not used, so it converts no picture.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "calib/camera.h"
#include "calib/cameras/camera_controls.h"
#include "calib/cameras/pixel_unpack.h"
#include "calib/cameras/v4l2_device.h"

namespace lenticule::calib {

struct FormatRequest {
  int width = 0;  ///< 0: as near to 1920x1080 as available
  int height = 0;
  double frames_per_second = 30.0;
  std::string pixel_format{};  ///< "YUYV"; empty: the best one for measuring
};

/// AgreedFormat is the format that the driver reports to deliver.
struct AgreedFormat {
  RawFormat raw;
  double frames_per_second = 0.0;  ///< 0 if the camera does not report it
};

struct FrameSize {
  int width = 0;
  int height = 0;
};

/// FormatOffer is one pixel format of a camera with its sizes; a range of sizes is represented by
/// its largest.
struct FormatOffer {
  uint32_t fourcc = 0;
  std::vector<FrameSize> sizes;
};

/// Returns the camera's formats, including formats that cannot be unpacked. Never throws for the
/// driver's answers; an endless list is cut off.
[[nodiscard]] std::vector<FormatOffer> offered_formats(V4l2Device& device);

/// Sets the format and the frame rate and reads them back. A format whose pictures have less than
/// half the requested pixels is tried after formats with more. Inputs that follow a signal (HDMI)
/// are set to the arriving signal. Throws Error(Device): no usable format, no signal, interlaced,
/// in use.
[[nodiscard]] AgreedFormat agree_on_format(V4l2Device& device, V4l2System& system,
                                           const std::string& path, const FormatRequest& request);

/// Returns the node that the user's text names; see V4l2Options::device. Throws Error(Device) when
/// there is no camera, Error(Usage) when there are several and none is named.
[[nodiscard]] V4l2Node find_camera(V4l2System& system, const std::string& wanted);

struct V4l2Options : FormatRequest, ControlRequests {
  /// "/dev/video2", "video2", or a name in /dev/v4l/by-id or by-path; empty: the only camera.
  std::string device;
  /// Pictures dropped after the start, because cameras deliver old ones or are still adjusting.
  int skipped_pictures = 4;
};

/// Opens a camera, negotiates a format, locks the controls and starts the stream. facts() reports
/// the format that the driver really delivers; facts().unlocked grows when timestamps turn out to
/// be unusable. now() is CLOCK_MONOTONIC. A camera that is Gone has been closed and must be opened
/// again. Throws Error(Device): missing, busy, no permission, not a camera, no usable format;
/// Error(Usage): several cameras and none named, options out of range.
///
/// Lifetime: `system` must outlive the camera.
[[nodiscard]] std::unique_ptr<Camera> open_v4l2_camera(const V4l2Options& options,
                                                       V4l2System& system = linux_v4l2());

struct CameraFormat {
  std::string pixel_format;
  bool usable = false;
  std::vector<std::string> sizes;  ///< "1920x1080"
};

struct CameraListing {
  std::string path;         ///< "/dev/video0"
  std::string stable_path;  ///< "/dev/v4l/by-id/...", empty if there is none
  std::string name;
  std::string bus;
  std::vector<CameraFormat> formats;
  std::string problem;  ///< reason why the node could not be queried; empty if it could
};

/// Lists all nodes that are cameras, and nodes that could not be opened. Starts no stream.
[[nodiscard]] std::vector<CameraListing> list_cameras(V4l2System& system = linux_v4l2());

}  // namespace lenticule::calib
