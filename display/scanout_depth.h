// SPDX-License-Identifier: Apache-2.0
// ScanoutDepth is the number of bits per colour of scan-out memory.
#pragma once

namespace lenticule::display {

enum class ScanoutDepth {
  Bits8,   ///< XRGB8888: words 0 R G B of 8 bits
  Bits10,  ///< XRGB2101010: words of 2 zero bits, then R G B of 10 bits
};

[[nodiscard]] constexpr int bits_of(ScanoutDepth depth) {
  return depth == ScanoutDepth::Bits10 ? 10 : 8;
}
/// Returns the name of the format in the kernel.
[[nodiscard]] constexpr const char* format_name(ScanoutDepth depth) {
  return depth == ScanoutDepth::Bits10 ? "XRGB2101010" : "XRGB8888";
}
/// Returns the end of the name of a display's mode.
[[nodiscard]] constexpr const char* depth_suffix(ScanoutDepth depth) {
  return depth == ScanoutDepth::Bits10 ? ", 10 bits per colour" : "";
}

}  // namespace lenticule::display
