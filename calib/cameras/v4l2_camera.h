// SPDX-License-Identifier: Apache-2.0
// Cameras of the kernel's V4L2: USB webcams, capture cards. The picture's way: the driver's buffer,
// V4L2's colour rules, linear light. Nothing is converted by libv4l.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calib/camera.h"

namespace lenticule::calib {

class V4l2System;

struct V4l2Options {
  /// "/dev/video2", "video2", or a name in /dev/v4l/by-id or by-path; empty: the only camera.
  std::string device;
  int width = 0;  ///< the nearest is taken; 0: near 1920x1080
  int height = 0;
  double frames_per_second = 30.0;
  std::string pixel_format{};  ///< "YUYV"; empty: the best one for measuring
  double refresh_hz = 60.0;    ///< of the display that will be looked at
  int exposure_periods = 2;    ///< refreshes per exposure
  std::optional<int> gain{};   ///< in the camera's own numbers; none: as it is
  std::optional<int> white_balance_kelvin{};
  std::optional<int> focus{};
  /// Pictures after the start that nobody sees: cameras deliver old ones, or still settle.
  int skipped_pictures = 4;
};

/// Opens, agrees on a format, locks the controls, starts. facts() tells what the driver really
/// gives; facts().unlocked grows when timestamps turn out to be unusable. now() is CLOCK_MONOTONIC.
/// A camera that is Gone has been closed: open it anew. Throws Error(Device): missing, busy,
/// forbidden, no camera, no usable format; Error(Usage): several cameras and none named, options
/// out of range.
[[nodiscard]] std::unique_ptr<Camera> open_v4l2_camera(const V4l2Options& options);
/// The same on another system; it must outlive the camera.
[[nodiscard]] std::unique_ptr<Camera> open_v4l2_camera(const V4l2Options& options,
                                                       V4l2System& system);

struct CameraFormat {
  std::string pixel_format;
  bool usable = false;
  std::vector<std::string> sizes;  ///< "1920x1080"
};

struct CameraListing {
  std::string path;         ///< "/dev/video0"
  std::string stable_path;  ///< "/dev/v4l/by-id/...", empty if it has none
  std::string name;
  std::string bus;
  std::vector<CameraFormat> formats;
  std::string problem;  ///< why it could not be asked; empty if it could
};

/// All nodes that are cameras, and those that could not be opened. Starts nothing.
[[nodiscard]] std::vector<CameraListing> list_cameras();
[[nodiscard]] std::vector<CameraListing> list_cameras(V4l2System& system);

}  // namespace lenticule::calib
