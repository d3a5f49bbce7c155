// SPDX-License-Identifier: Apache-2.0
// Negotiates format, size and frame rate with a camera.
#pragma once

#include <string>
#include <vector>

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

}  // namespace lenticule::calib
