// SPDX-License-Identifier: Apache-2.0
// Decoded pictures as 8-bit RGB, rounded once and to the nearest code.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "apps/lenticule-video/pixel_layout.h"

namespace lenticule::video {

/// 8-bit RGB passes byte for byte; deeper RGB becomes round(255 v / (2^depth - 1)). Y'CbCr follows
/// ITU-R BT.601/709/2020: R = Y' + 2 (1 - Kr) Cr and so on, chroma of lower resolution interpolated
/// linearly from where its samples lie, all in one exact sum that is then rounded half up and
/// clipped. Neither gamut nor transfer function is touched: code values stay code values.
///
/// One thread; convert() allocates nothing.
class PixelConverter {
 public:
  PixelConverter(const PixelLayout& layout, int width, int height);

  /// `rgb` takes width * height * 3 bytes; the picture has the constructor's size.
  void convert(const PicturePlanes& picture, std::span<uint8_t> rgb);

 private:
  /// What one chroma position takes from two neighbouring samples, in parts of the axis' whole.
  struct Tap {
    int first = 0;
    int second = 0;
    int weight_second = 0;
  };

  [[nodiscard]] static std::vector<Tap> taps(int luma, int shift, int site);
  void plan_matrix();
  void unpack(const PicturePlanes& picture, int component, int row, int count, uint16_t* out) const;
  void rgb_row(const PicturePlanes& picture, int row, uint8_t* out);
  void grey_row(const PicturePlanes& picture, int row, uint8_t* out);
  void yuv_row(const PicturePlanes& picture, int row, uint8_t* out);
  void chroma_row(const PicturePlanes& picture, int component, int row, std::vector<int32_t>& out);

  PixelLayout layout_;
  int width_;
  int height_;
  int chroma_width_;
  int chroma_height_;
  bool copies_bytes_;
  std::vector<uint8_t> code_of_value_;  ///< of RGB and grey
  std::vector<Tap> across_;
  std::vector<Tap> down_;
  std::vector<uint16_t> values_;
  std::vector<uint16_t> second_;
  std::vector<int32_t> cb_;
  std::vector<int32_t> cr_;

  // Everything times 2^kFraction, per code value of luma and per part of a chroma code value.
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
