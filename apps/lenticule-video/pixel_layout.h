// SPDX-License-Identifier: Apache-2.0
// PixelLayout describes a decoded picture in memory and the meaning of its values, without FFmpeg's
// types.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace lenticule::video {

/// Position of one channel's samples, for every packed or planar format of whole bytes.
struct PixelComponent {
  int plane = 0;
  int step = 1;    ///< bytes from one sample to the next
  int offset = 0;  ///< bytes before the first one
  int shift = 0;   ///< bits to the right of the value
  int depth = 8;   ///< bits of the value, 1..16
};

enum class ColourModel { Rgb, Grey, Yuv };

/// Position of a chroma sample among its luma samples: 0 at the first of them, 1 in the middle, 2
/// at the last one.
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
  bool full_range = true;  ///< Y'CbCr range is 0..255 instead of 16..235 (in 8 bits)
  double kr = 0.2126;      ///< weights of red and blue in Y'
  double kb = 0.0722;

  [[nodiscard]] bool subsampled() const { return chroma_shift_x > 0 || chroma_shift_y > 0; }
};

/// A borrowed picture. Rows may be stored bottom-up (negative strides).
struct PicturePlanes {
  std::array<const uint8_t*, 4> data = {};
  std::array<ptrdiff_t, 4> stride = {};
  int width = 0;
  int height = 0;
};

}  // namespace lenticule::video
