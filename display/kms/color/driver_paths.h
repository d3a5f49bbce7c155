// SPDX-License-Identifier: Apache-2.0
// Lists how kernel drivers process an XRGB8888 frame on its way out, according to their sources. A
// driver does not report this: all accept the format, and some convert it internally.
#pragma once

#include <span>
#include <string_view>

namespace lenticule::display {

enum class PathKind {
  AsItIs,  ///< every subpixel leaves the driver unchanged
  Alters,  ///< subpixels are rounded, compressed, scaled or late
};

struct DriverPath {
  const char* driver;  ///< name that DRM_IOCTL_VERSION returns
  PathKind kind;
  const char* fact;
  /// File and function in the kernel's sources, or the manufacturer's documentation.
  const char* source;
  /// Fact about frames in XRGB2101010; null if the sources were read for XRGB8888 only.
  const char* fact_of_ten_bits = nullptr;
};

[[nodiscard]] std::span<const DriverPath> driver_paths();
/// Returns null for a driver that is not listed.
[[nodiscard]] const DriverPath* find_driver_path(std::string_view driver);

}  // namespace lenticule::display
