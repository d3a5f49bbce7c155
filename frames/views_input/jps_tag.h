// SPDX-License-Identifier: Apache-2.0
// Reads the stereo layout of a JPEG with two eyes' pictures (.jps) from the file's own tag.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "frames/views_input/content_name.h"

namespace lenticule::frames {

struct JpsTag {
  StereoLayout stereo;
  bool right_first = true;  ///< the right eye's picture is the left or the upper one
};

/// Returns true for a name that ends in .jps.
[[nodiscard]] bool is_jps_name(const std::filesystem::path& file);

/// Parses the stereoscopic descriptor in the first bytes of the file. Without a descriptor, returns
/// the format's usual layout: side by side, the right eye's picture on the left. Throws
/// Error(Input) "name: cause" for unsupported layouts, such as interlaced rows.
[[nodiscard]] JpsTag parse_jps_tag(std::span<const uint8_t> head, const std::string& name);

/// Reads the tag of a file. Throws Error(Input) also for a file that cannot be read.
[[nodiscard]] JpsTag read_jps_tag(const std::filesystem::path& file);

}  // namespace lenticule::frames
