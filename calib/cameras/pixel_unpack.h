// SPDX-License-Identifier: Apache-2.0
// PixelUnpacker converts a camera's bytes to pictures in linear light.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/camera.h"
#include "calib/cameras/colour_coding.h"
#include "calib/cameras/jpeg_unpack.h"
#include "calib/cameras/pixel_layout.h"

namespace lenticule::calib {

/// RawFormat describes the memory layout of a picture and the coding of its samples.
struct RawFormat {
  uint32_t fourcc = 0;
  int width = 0;
  int height = 0;
  size_t bytes_per_line = 0;  ///< 0: rows without padding
  ColourCoding coding;
};

/// PixelUnpacker supports GREY, Y16, Y12, Y10 (one channel), 8-bit Bayer (RGGB, GRBG, BA81, GBRG;
/// interpolated bilinearly in linear light), YUYV, UYVY, NV12 (colours repeated, not interpolated),
/// RGB3, BGR3, MJPG, JPEG. It does not convert between colour primaries: R, G, B are the camera's
/// own. Codes below black give light 0, codes above white give light 1.
///
/// Thread safety: one thread.
class PixelUnpacker {
 public:
  /// Throws Error(Device) that names `camera` for an unsupported format, for pictures of size zero
  /// or an excessive size (a side above 16384, more than 2^26 pixels), and for rows that overlap or
  /// are implausibly long.
  PixelUnpacker(const RawFormat& format, const std::string& camera);

  [[nodiscard]] int channels() const { return layout_.channels(); }
  /// Returns the bytes of a whole picture; 0 for JPEG, whose size varies.
  [[nodiscard]] size_t bytes_needed() const { return bytes_needed_; }
  /// Sets size, channels and light, reusing the memory of `out`. Returns false if the bytes are too
  /// few or damaged; the light of `out` is undefined then.
  [[nodiscard]] bool unpack(std::span<const uint8_t> bytes, CameraPicture& out);

 private:
  [[nodiscard]] const uint8_t* row(std::span<const uint8_t> bytes, int y) const;
  void unpack_grey8(std::span<const uint8_t> bytes, std::span<float> light) const;
  void unpack_grey16(std::span<const uint8_t> bytes, std::span<float> light) const;
  void unpack_bayer(std::span<const uint8_t> bytes, std::span<float> light);
  void unpack_yuv422(std::span<const uint8_t> bytes, std::span<float> light) const;
  void unpack_nv12(std::span<const uint8_t> bytes, std::span<float> light) const;
  void unpack_rgb(std::span<const uint8_t> bytes, std::span<float> light) const;
  [[nodiscard]] bool unpack_jpeg(std::span<const uint8_t> bytes, std::span<float> light);
  void put_ycbcr(uint8_t luma, uint8_t cb, uint8_t cr, float* rgb) const;

  PixelLayout layout_;
  RawFormat format_;
  size_t bytes_needed_ = 0;
  TransferCurve curve_;
  std::array<float, 256> light_of_code_{};    // 8-bit luma or R'G'B'
  std::array<float, 256> encoded_of_luma_{};  // black 0, white 1
  std::array<float, 256> chroma_of_code_{};   // -1/2 to 1/2
  float wide_black_ = 0.0F;                   // scale of samples of more than 8 bits
  float wide_per_code_ = 1.0F;
  YcbcrMatrix matrix_;
  std::vector<float> mosaic_;
  std::optional<JpegDecoder> jpeg_;
};

}  // namespace lenticule::calib
