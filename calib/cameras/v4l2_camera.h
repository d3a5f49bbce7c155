// SPDX-License-Identifier: Apache-2.0
// Opens cameras of the kernel's V4L2: USB webcams, capture cards. Data flow: the driver's buffer,
// V4L2's colour rules, linear light. libv4l is not used, so it converts no picture.
#pragma once

#include <memory>
#include <string>

#include "calib/camera.h"
#include "calib/cameras/camera_controls.h"
#include "calib/cameras/pixel_unpack.h"
#include "frames/capture/capture_format.h"

namespace lenticule::calib {

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

}  // namespace lenticule::calib
