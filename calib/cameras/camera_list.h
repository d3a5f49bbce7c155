// SPDX-License-Identifier: Apache-2.0
// Finds the video nodes that are cameras.
#pragma once

#include <memory>
#include <string>

#include "calib/cameras/v4l2_device.h"

namespace lenticule::calib {

struct NodeFacts {
  std::string name;
  std::string bus;
  bool captures = false;  ///< captures pictures into mapped memory
};

/// Queries the node's own capabilities, not those of the whole device: USB cameras have a second
/// node that is not a camera. Returns 0 or errno.
[[nodiscard]] int ask_node(V4l2Device& device, NodeFacts& facts);

/// Returns the node that the user's text names; see V4l2Options::device. Throws Error(Device) when
/// there is no camera, Error(Usage) when there are several and none is named.
[[nodiscard]] V4l2Node find_camera(V4l2System& system, const std::string& wanted);

}  // namespace lenticule::calib
