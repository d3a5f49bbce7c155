// SPDX-License-Identifier: Apache-2.0
// What kernel drivers do with an XRGB8888 frame on its way out, as their sources say. No driver
// tells this by itself: all of them accept the format, and some convert it inside.
#pragma once

#include <span>
#include <string_view>

namespace lenticule::display {

enum class PathKind {
  AsItIs,  ///< every subpixel leaves the driver as it is in the buffer
  Alters,  ///< subpixels are rounded, compressed, scaled or late
};

struct DriverPath {
  const char* driver;  ///< as DRM_IOCTL_VERSION gives it
  PathKind kind;
  const char* fact;
  const char* source;  ///< file and function in the kernel's sources, or the maker's words
};

[[nodiscard]] std::span<const DriverPath> driver_paths();
/// Null for a driver whose sources were not read.
[[nodiscard]] const DriverPath* find_driver_path(std::string_view driver);

}  // namespace lenticule::display
