// SPDX-License-Identifier: Apache-2.0
// Pixel formats of cameras: their names, and where their samples lie.
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
  int red_column = 0;   ///< Bayer: of the first red pixel
  int red_row = 0;      ///< the same
  int luma_byte = 0;    ///< 4:2:2: of the first pixel; the second one's is two further
  int chroma_byte = 1;  ///< 4:2:2: of Cb; that of Cr is two further
  int red_byte = 0;     ///< RGB: 0 or 2

  [[nodiscard]] int channels() const {
    return packing == Packing::Grey8 || packing == Packing::Grey16 ? 1 : 3;
  }
  [[nodiscard]] Samples samples() const;
};

/// The formats that can be unpacked, best for measuring first: samples as the sensor gave them,
/// then those that share colours between pixels, then those that lose something.
[[nodiscard]] std::span<const PixelLayout> supported_layouts();
/// Null for formats that cannot be unpacked.
[[nodiscard]] const PixelLayout* layout_of(uint32_t fourcc);
/// By name, "YUYV"; null for others.
[[nodiscard]] const PixelLayout* layout_named(std::string_view name);
/// "YUYV"; where the bytes cannot be printed, "0x00000001".
[[nodiscard]] std::string fourcc_name(uint32_t fourcc);

/// Bytes of one row of the first plane without padding; 0 for JPEG.
[[nodiscard]] size_t row_bytes(const PixelLayout& layout, int width);
/// Bytes of a whole picture with rows of `bytes_per_line`, the last one without padding; 0 for
/// JPEG.
[[nodiscard]] size_t picture_bytes(const PixelLayout& layout, int width, int height,
                                   size_t bytes_per_line);

}  // namespace lenticule::calib
