// SPDX-License-Identifier: Apache-2.0
// decoder_filter lists the system calls that a decoder may make, as a classic BPF program.
#pragma once

#include <linux/filter.h>

#include <vector>

namespace lenticule::video {

/// Devices that a decoder may open beside the descriptors that it has.
enum class Devices {
  None,
  /// Opening files and listing folders, which Landlock must restrict, and controlling video devices
  /// (VIDIOC_...).
  Video,
};

/// Returns a filter in which calls that are not listed fail with EPERM, and calls of a foreign
/// architecture kill the process. Signals to other processes, connecting, executing, changing
/// identity or scheduling, and executable memory are not allowed; neither is opening without
/// devices. Uses one descriptor while it runs. Throws Error(Failed).
[[nodiscard]] std::vector<sock_filter> decoder_filter(Devices devices = Devices::None);

}  // namespace lenticule::video
