// SPDX-License-Identifier: Apache-2.0
// PixelConverter converts decoded pictures to 8-bit RGB, rounded once and to the nearest code.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "apps/lenticule-video/pixel_kernel.h"

namespace lenticule::video {

// PixelLayout describes a decoded picture in memory and the meaning of its values, without FFmpeg's
// types.

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

/// Copies 8-bit RGB unchanged; deeper RGB becomes round(255 v / (2^depth - 1)). Y'CbCr follows
/// ITU-R BT.601/709/2020: R = Y' + 2 (1 - Kr) Cr and so on. Subsampled chroma is interpolated
/// linearly from the positions of its samples. Everything is computed in one exact sum, which is
/// then rounded half up and clipped. Gamut and transfer function are not changed: code values stay
/// code values.
///
/// Up to 10 bits, a kernel computes the sums in 32 bits, and the few pixels whose rounding the
/// error might change are computed again exactly. Only 8 bits with chroma of half the columns,
/// which is views before they are woven, are converted in 16 bits: with an error below 1/16 code
/// before rounding, and greys exactly.
///
/// convert() allocates no memory. Thread safety: one thread.
class PixelConverter {
 public:
  PixelConverter(const PixelLayout& layout, int width, int height, Isa isa = best_isa());

  /// Converts a picture of the constructor's size; `rgb` holds width * height * 3 bytes.
  void convert(const PicturePlanes& picture, std::span<uint8_t> rgb);

 private:
  /// The weights of two neighbouring chroma samples at one luma position, in parts of the axis's
  /// total.
  struct Tap {
    int first = 0;
    int second = 0;
    int weight_second = 0;
  };

  [[nodiscard]] static std::vector<Tap> taps(int luma, int shift, int site);
  void plan_matrix();
  void plan_sums();
  void unpack(const PicturePlanes& picture, int component, int row, int count, uint16_t* out) const;
  void rgb_row(const PicturePlanes& picture, int row, uint8_t* out);
  void grey_row(const PicturePlanes& picture, int row, uint8_t* out);
  void yuv_row(const PicturePlanes& picture, int row, uint8_t* out);
  void chroma_row(const PicturePlanes& picture, int component, int row, std::vector<int32_t>& out);
  void fast_yuv_row(const PicturePlanes& picture, int row, uint8_t* out);
  void fast_chroma_row(const PicturePlanes& picture, int component, int row,
                       std::vector<int16_t>& out);
  void plan_short_sums();
  void short_yuv_row(const PicturePlanes& picture, int row, uint8_t* out);
  void short_chroma_row(const PicturePlanes& picture, int component, int row,
                        std::vector<int16_t>& out);
  void exact_pixel(int64_t luma, int64_t cb, int64_t cr, uint8_t* out) const;

  PixelLayout layout_;
  int width_;
  int height_;
  int chroma_width_;
  int chroma_height_;
  bool copies_bytes_;
  std::vector<uint8_t> code_of_value_;  ///< used for RGB and grey
  std::vector<Tap> across_;
  std::vector<Tap> down_;
  std::vector<uint16_t> values_;
  std::vector<uint16_t> second_;
  std::vector<int32_t> cb_;
  std::vector<int32_t> cr_;

  // Working memory of the kernels; `mixed_`, and chroma in 16 bits, begin with a copy of the first
  // sample.
  const PixelKernel* kernel_;
  bool fast_ = false;
  Sums sums_{};
  bool short_ = false;
  ShortSums short_sums_{};
  std::vector<int16_t> mixed_, fast_cb_, fast_cr_;
  std::vector<uint8_t> row_, doubtful_;

  // Coefficients times 2^kFraction, per code value of luma and per part of a chroma code value.
  int64_t luma_ = 0;
  int64_t red_cr_ = 0;
  int64_t green_cb_ = 0;
  int64_t green_cr_ = 0;
  int64_t blue_cb_ = 0;
  int64_t red_0_ = 0;
  int64_t green_0_ = 0;
  int64_t blue_0_ = 0;
};

}  // namespace lenticule::video
