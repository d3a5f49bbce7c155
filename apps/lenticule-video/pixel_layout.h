// SPDX-License-Identifier: Apache-2.0
// How a decoded picture lies in memory and what its numbers mean. Knows nothing of FFmpeg.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace lenticule::video {

/// Where one channel's samples are, as in every chunky or planar format of whole bytes.
struct PixelComponent {
  int plane = 0;
  int step = 1;    ///< bytes from one sample to the next
  int offset = 0;  ///< bytes before the first one
  int shift = 0;   ///< bits to the right of the value
  int depth = 8;   ///< bits of the value, 1..16
};

enum class ColourModel { Rgb, Grey, Yuv };

/// Where chroma samples lie among the luma samples that they stand for: 0 at the first of them, 1
/// in the middle, 2 at the last one.
struct ChromaSite {
  int across = 0;
  int down = 1;
};

struct PixelLayout {
  ColourModel model = ColourModel::Rgb;
  std::array<PixelComponent, 3> components = {};  ///< R, G, B, or Y', Cb, Cr, or Y' alone
  bool big_endian = false;                        ///< samples of more than 8 bits
  int chroma_shift_x = 0;                         ///< log2 of luma samples per chroma sample
  int chroma_shift_y = 0;
  ChromaSite site;
  bool full_range = true;  ///< of Y'CbCr: 0..255 and not 16..235 (in 8 bits)
  double kr = 0.2126;      ///< weights of red and blue in Y'
  double kb = 0.0722;

  [[nodiscard]] bool subsampled() const { return chroma_shift_x > 0 || chroma_shift_y > 0; }
};

/// Borrowed picture. Rows may be stored upward (negative strides).
struct PicturePlanes {
  std::array<const uint8_t*, 4> data = {};
  std::array<ptrdiff_t, 4> stride = {};
  int width = 0;
  int height = 0;
};

}  // namespace lenticule::video
