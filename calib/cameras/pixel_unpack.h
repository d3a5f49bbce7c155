// SPDX-License-Identifier: Apache-2.0
// PixelUnpacker converts a camera's bytes to pictures in linear light: the format's layout says
// where the codes are, its colour coding which light they mean.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "calib/camera.h"

namespace lenticule::calib {

/// ColourCoding says how codes mean colours: V4L2's colour space, Y'CbCr encoding, quantization and
/// transfer function, with V4L2's rules for values that a driver leaves open (the kernel's
/// documentation, "Defining Colorspaces" and the macros V4L2_MAP_*_DEFAULT). The values are the
/// driver's; 0 is "default" in every field. Values that V4L2 does not define count as 0.
struct ColourCoding {
  uint32_t colorspace = 0;
  uint32_t ycbcr_enc = 0;
  uint32_t quantization = 0;
  uint32_t xfer_func = 0;
};

/// Samples is the kind of samples. Bayer and decoded JPEG are Rgb.
enum class Samples { Rgb, Ycbcr, Luma };

/// Resolves all defaults; the result still has V4L2's numbers. Luma alone is full range unless the
/// driver states otherwise: V4L2's rule does not cover it, but sensors and the kernel's test driver
/// deliver full range.
[[nodiscard]] ColourCoding resolved(ColourCoding coding, Samples samples);

/// CodeScale maps codes of `bits` bits to encoded values: black is 0, white is 1.
struct CodeScale {
  double black = 0.0;
  double per_code = 1.0;         ///< scale of luma and R'G'B'
  double chroma_middle = 0.0;    ///< the code of no colour
  double chroma_per_code = 1.0;  ///< Cb and Cr range from -1/2 to 1/2
};
[[nodiscard]] CodeScale code_scale(const ColourCoding& resolved_coding, int bits);

/// YcbcrMatrix: R' = Y' + red_cr Cr, G' = Y' + green_cb Cb + green_cr Cr, B' = Y' + blue_cb Cb.
/// Constant luminance is treated like non-constant luminance.
struct YcbcrMatrix {
  double red_cr = 0.0;
  double green_cb = 0.0;
  double green_cr = 0.0;
  double blue_cb = 0.0;
};
[[nodiscard]] YcbcrMatrix ycbcr_matrix(const ColourCoding& resolved_coding);

/// Returns the linear light of an encoded value in [0, 1], by the formula. BT.2084 maps 10000 cd/m2
/// to 1.
[[nodiscard]] double linear_by_formula(uint32_t resolved_xfer_func, double encoded);

/// TransferCurve tabulates linear_by_formula(); encoded values outside [0, 1] are clipped.
/// Immutable.
///
/// Thread safety: any thread.
class TransferCurve {
 public:
  explicit TransferCurve(uint32_t resolved_xfer_func);

  [[nodiscard]] float operator()(float encoded) const noexcept {
    const float held = encoded > 0.0F ? (encoded < 1.0F ? encoded : 1.0F) : 0.0F;
    const float place = held * kSteps;
    const auto step = static_cast<size_t>(place);
    const float below = table_[step];
    return below + (table_[step + 1] - below) * (place - static_cast<float>(step));
  }

 private:
  static constexpr int kSteps = 4096;
  std::vector<float> table_;  // one entry more than there are steps, and the last entry twice
};

enum class Packing {
  Grey8,
  Grey16,  ///< little-endian, the value in the low bits
  Bayer8,
  Yuv422,  ///< four bytes for two pixels
  Nv12,    ///< a plane of luma, then one of Cb and Cr for 2x2 pixels
  Rgb,
  Jpeg,
};

/// PixelLayout describes the pixel formats of cameras: their names, and the positions of their
/// samples.
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
  /// Accepts a picture of exactly this size, also with extra bytes between picture and end marker,
  /// which many cameras send.
  [[nodiscard]] bool unpack_jpeg(std::span<const uint8_t> bytes, std::span<float> light);
  void set_ycbcr(uint8_t luma, uint8_t cb, uint8_t cr, float* rgb) const;

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
  struct CloseJpeg {
    void operator()(void* handle) const noexcept;
  };
  std::vector<float> mosaic_;
  std::unique_ptr<void, CloseJpeg> jpeg_;  ///< handle of libjpeg-turbo, for JPEG alone
  std::vector<uint8_t> rgb_;
};

}  // namespace lenticule::calib
