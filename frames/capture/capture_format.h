// SPDX-License-Identifier: Apache-2.0
// Finds the kernel's cameras and agrees with one of them on the format of its pictures.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "frames/capture/pixel_layout.h"
#include "frames/capture/v4l2_device.h"

namespace lenticule::frames::capture {

struct FrameSize {
  int width = 0;
  int height = 0;
};

struct FormatRequest {
  int width = 0;  ///< 0: as near to 1920x1080 as available
  int height = 0;
  double frames_per_second = 30.0;
  std::string pixel_format{};  ///< "YUYV"; empty: the best one
  /// Chooses for a display and not for measuring: colours that need no decoding first, but neither
  /// much slower nor much smaller than requested.
  bool for_display = false;
  FrameSize display{};  ///< size that the display can use
};

/// AgreedFormat is the format that the driver reports to deliver.
struct AgreedFormat {
  RawFormat raw;
  double frames_per_second = 0.0;  ///< 0 if the camera does not report it
};

/// FormatOffer is one pixel format of a camera with its sizes; a range of sizes is represented by
/// its largest.
struct FormatOffer {
  uint32_t fourcc = 0;
  std::vector<FrameSize> sizes;

  [[nodiscard]] std::string pixel_format() const { return fourcc_name(fourcc); }
  /// Returns true if the pixels can be unpacked.
  [[nodiscard]] bool usable() const { return layout_of(fourcc) != nullptr; }
  /// Returns names such as "1920x1080".
  [[nodiscard]] std::vector<std::string> size_names() const;
};

/// Returns the camera's formats, including formats that cannot be unpacked. Never throws for the
/// driver's answers; an endless list is cut off.
[[nodiscard]] std::vector<FormatOffer> offered_formats(V4l2Device& device);

/// Returns what is wrong with the signal of the input in use, as "no signal"; empty for cameras and
/// for drivers that do not say.
[[nodiscard]] std::string signal_problem(V4l2Device& device);

/// Sets the format and the frame rate and reads them back. A format whose pictures have less than
/// half the requested pixels is tried after formats with more. Inputs that follow a signal (HDMI)
/// are set to the arriving signal. Throws Error(Device): no usable format, no signal, interlaced,
/// in use; for a display, another size than the requested one.
[[nodiscard]] AgreedFormat agree_on_format(V4l2Device& device, V4l2System& system,
                                           const std::string& path, const FormatRequest& request);

/// Returns the node that the user's text names; see V4l2Options::device. Throws Error(Device) when
/// there is no camera, Error(Usage) when there are several and none is named.
[[nodiscard]] V4l2Node find_camera(V4l2System& system, const std::string& wanted);

/// NodeFacts describes a video node.
struct NodeFacts {
  std::string name;
  std::string bus;
  bool captures = false;  ///< captures pictures into mapped memory
};

/// Opens a camera. Throws Error(Device): missing, busy, no permission, not a camera.
[[nodiscard]] std::unique_ptr<V4l2Device> open_camera(V4l2System& system, const std::string& path,
                                                      NodeFacts& facts);

struct CameraListing {
  std::string path;         ///< "/dev/video0"
  std::string stable_path;  ///< "/dev/v4l/by-id/...", empty if there is none
  std::string name{};
  std::string bus{};
  std::vector<FormatOffer> formats{};
  std::string problem{};  ///< reason why the node could not be queried; empty if it could
};

/// Lists all nodes that are cameras, and nodes that could not be opened. Starts no stream.
[[nodiscard]] std::vector<CameraListing> list_cameras(V4l2System& system = linux_v4l2());

}  // namespace lenticule::frames::capture
