// SPDX-License-Identifier: Apache-2.0
// PixelLayout describes the pixel formats of cameras: their names, and the positions of their
// samples.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "calib/cameras/colour_coding.h"

namespace lenticule::calib {

enum class Packing {
  Grey8,
  Grey16,  ///< little-endian, the value in the low bits
  Bayer8,
  Yuv422,  ///< four bytes for two pixels
  Nv12,    ///< a plane of luma, then one of Cb and Cr for 2x2 pixels
  Rgb,
  Jpeg,
};

struct PixelLayout {
  uint32_t fourcc = 0;  ///< V4L2's code
  Packing packing = Packing::Grey8;
  int bits = 8;
  int red_column = 0;  ///< Bayer: column of the first red pixel
  int red_row = 0;     ///< Bayer: row of the first red pixel
  int luma_byte = 0;   ///< 4:2:2: byte of the first pixel's luma; the second pixel's is two further
  int chroma_byte = 1;  ///< 4:2:2: byte of Cb; Cr is two further
  int red_byte = 0;     ///< RGB: 0 or 2

  [[nodiscard]] int channels() const {
    return packing == Packing::Grey8 || packing == Packing::Grey16 ? 1 : 3;
  }
  [[nodiscard]] Samples samples() const;
};

/// Returns the formats that can be unpacked, best for measuring first: raw sensor samples, then
/// formats that share colours between pixels, then lossy ones.
[[nodiscard]] std::span<const PixelLayout> supported_layouts();
/// Returns null for formats that cannot be unpacked.
[[nodiscard]] const PixelLayout* layout_of(uint32_t fourcc);
/// Returns the layout of a name such as "YUYV"; null for others.
[[nodiscard]] const PixelLayout* layout_named(std::string_view name);
/// Returns a name such as "YUYV", or "0x00000001" if the bytes are not printable.
[[nodiscard]] std::string fourcc_name(uint32_t fourcc);

/// Returns the bytes of one row of the first plane without padding; 0 for JPEG.
[[nodiscard]] size_t row_bytes(const PixelLayout& layout, int width);
/// Returns the bytes of a whole picture with rows of `bytes_per_line`, the last one without
/// padding; 0 for JPEG.
[[nodiscard]] size_t picture_bytes(const PixelLayout& layout, int width, int height,
                                   size_t bytes_per_line);

}  // namespace lenticule::calib
