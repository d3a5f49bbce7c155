// SPDX-License-Identifier: Apache-2.0
// Two eyes in one JPEG (.jps), as the file itself says they lie.
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

/// True for a name that ends in .jps.
[[nodiscard]] bool is_jps_name(const std::filesystem::path& file);

/// What the stereoscopic descriptor says, given the first bytes of the file. Without one, the
/// format's usual way: beside each other, the right eye's picture on the left. Throws Error(Input)
/// "name: cause" for layouts that are not read, such as interlaced rows.
[[nodiscard]] JpsTag parse_jps_tag(std::span<const uint8_t> head, const std::string& name);

/// The same of a file. Throws Error(Input) also for one that cannot be read.
[[nodiscard]] JpsTag read_jps_tag(const std::filesystem::path& file);

}  // namespace lenticule::frames
