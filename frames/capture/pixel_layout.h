// SPDX-License-Identifier: Apache-2.0
// PixelLayout says where the codes of a camera's picture lie in its bytes, ColourCoding which
// colours they mean.
#pragma once

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "base/error_kinds.h"

namespace lenticule::frames::capture {

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

/// Returns a number that V4L2 defines, or 0.
inline uint32_t known(uint32_t number, uint32_t largest) { return number <= largest ? number : 0; }

/// Resolves all defaults; the result still has V4L2's numbers. Luma alone is full range unless the
/// driver states otherwise: V4L2's rule does not cover it, but sensors and the kernel's test driver
/// deliver full range.
[[nodiscard]] inline ColourCoding resolved(ColourCoding coding, Samples samples) {
  coding.colorspace = known(coding.colorspace, V4L2_COLORSPACE_DCI_P3);
  coding.ycbcr_enc = known(coding.ycbcr_enc, V4L2_YCBCR_ENC_SMPTE240M);
  coding.quantization = known(coding.quantization, V4L2_QUANTIZATION_LIM_RANGE);
  coding.xfer_func = known(coding.xfer_func, V4L2_XFER_FUNC_SMPTE2084);
  // A webcam is neither SDTV nor HDTV.
  if (coding.colorspace == V4L2_COLORSPACE_DEFAULT)
    coding.colorspace = V4L2_MAP_COLORSPACE_DEFAULT(false, false);
  const uint32_t space = coding.colorspace;
  if (coding.ycbcr_enc == V4L2_YCBCR_ENC_DEFAULT)
    coding.ycbcr_enc = V4L2_MAP_YCBCR_ENC_DEFAULT(space);
  if (coding.xfer_func == V4L2_XFER_FUNC_DEFAULT)
    coding.xfer_func = V4L2_MAP_XFER_FUNC_DEFAULT(space);
  if (coding.quantization == V4L2_QUANTIZATION_DEFAULT) {
    // Raw sensors have no headroom, although V4L2's rule assigns some to their Y'CbCr.
    const bool full = samples != Samples::Ycbcr || space == V4L2_COLORSPACE_RAW;
    coding.quantization = V4L2_MAP_QUANTIZATION_DEFAULT(full, space, coding.ycbcr_enc);
  }
  return coding;
}

/// CodeScale maps codes of `bits` bits to encoded values: black is 0, white is 1.
struct CodeScale {
  double black = 0.0;
  double per_code = 1.0;         ///< scale of luma and R'G'B'
  double chroma_middle = 0.0;    ///< the code of no colour
  double chroma_per_code = 1.0;  ///< Cb and Cr range from -1/2 to 1/2
};
[[nodiscard]] inline CodeScale code_scale(const ColourCoding& resolved_coding, int bits) {
  const double largest = std::ldexp(1.0, bits) - 1.0;
  const double step = std::ldexp(1.0, bits - 8);  // limited range is defined for 8 bits
  if (resolved_coding.quantization == V4L2_QUANTIZATION_FULL_RANGE)
    return {.black = 0.0,
            .per_code = 1.0 / largest,
            .chroma_middle = 128.0 * step,
            .chroma_per_code = 1.0 / largest};
  return {.black = 16.0 * step,
          .per_code = 1.0 / (219.0 * step),
          .chroma_middle = 128.0 * step,
          .chroma_per_code = 1.0 / (224.0 * step)};
}

/// YcbcrMatrix: R' = Y' + red_cr Cr, G' = Y' + green_cb Cb + green_cr Cr, B' = Y' + blue_cb Cb.
/// Constant luminance is treated like non-constant luminance.
struct YcbcrMatrix {
  double red_cr = 0.0;
  double green_cb = 0.0;
  double green_cr = 0.0;
  double blue_cb = 0.0;
};
struct LumaWeights {
  double red;
  double blue;
};

inline LumaWeights luma_weights(uint32_t encoding) {
  switch (encoding) {
    case V4L2_YCBCR_ENC_709:
    case V4L2_YCBCR_ENC_XV709:
      return {.red = 0.2126, .blue = 0.0722};
    case V4L2_YCBCR_ENC_BT2020:
    case V4L2_YCBCR_ENC_BT2020_CONST_LUM:
      return {.red = 0.2627, .blue = 0.0593};
    case V4L2_YCBCR_ENC_SMPTE240M:
      return {.red = 0.212, .blue = 0.087};
    default:
      return {.red = 0.299, .blue = 0.114};
  }
}

[[nodiscard]] inline YcbcrMatrix ycbcr_matrix(const ColourCoding& resolved_coding) {
  const auto [red, blue] = luma_weights(resolved_coding.ycbcr_enc);
  const double green = 1.0 - red - blue;
  return {.red_cr = 2.0 * (1.0 - red),
          .green_cb = -2.0 * blue * (1.0 - blue) / green,
          .green_cr = -2.0 * red * (1.0 - red) / green,
          .blue_cb = 2.0 * (1.0 - blue)};
}

/// Packing decides how many bytes hold a pixel; see unit_of().
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
  /// Bytes of R, G, B or Y, Cb, Cr of the first pixel. With NV12, Cb and Cr lie in the second
  /// plane.
  std::array<int, 3> at{};

  [[nodiscard]] int channels() const {
    return packing == Packing::Grey8 || packing == Packing::Grey16 ? 1 : 3;
  }
  [[nodiscard]] Samples samples() const {
    if (channels() == 1) return Samples::Luma;
    return packing == Packing::Yuv422 || packing == Packing::Nv12 ? Samples::Ycbcr : Samples::Rgb;
  }
};

/// The formats that can be unpacked, best for measuring first: raw sensor samples, then formats
/// that share colours between pixels, then lossy ones.
inline constexpr std::array kLayouts{
    PixelLayout{.fourcc = V4L2_PIX_FMT_GREY},
    PixelLayout{.fourcc = V4L2_PIX_FMT_Y16, .packing = Packing::Grey16, .bits = 16},
    PixelLayout{.fourcc = V4L2_PIX_FMT_Y12, .packing = Packing::Grey16, .bits = 12},
    PixelLayout{.fourcc = V4L2_PIX_FMT_Y10, .packing = Packing::Grey16, .bits = 10},
    PixelLayout{.fourcc = V4L2_PIX_FMT_SRGGB8, .packing = Packing::Bayer8},
    PixelLayout{.fourcc = V4L2_PIX_FMT_SGRBG8, .packing = Packing::Bayer8, .red_column = 1},
    PixelLayout{
        .fourcc = V4L2_PIX_FMT_SBGGR8, .packing = Packing::Bayer8, .red_column = 1, .red_row = 1},
    PixelLayout{.fourcc = V4L2_PIX_FMT_SGBRG8, .packing = Packing::Bayer8, .red_row = 1},
    PixelLayout{.fourcc = V4L2_PIX_FMT_YUYV, .packing = Packing::Yuv422, .at = {0, 1, 3}},
    PixelLayout{.fourcc = V4L2_PIX_FMT_UYVY, .packing = Packing::Yuv422, .at = {1, 0, 2}},
    PixelLayout{.fourcc = V4L2_PIX_FMT_NV12, .packing = Packing::Nv12, .at = {0, 0, 1}},
    PixelLayout{.fourcc = V4L2_PIX_FMT_RGB24, .packing = Packing::Rgb, .at = {0, 1, 2}},
    PixelLayout{.fourcc = V4L2_PIX_FMT_BGR24, .packing = Packing::Rgb, .at = {2, 1, 0}},
    PixelLayout{.fourcc = V4L2_PIX_FMT_MJPEG, .packing = Packing::Jpeg},
    PixelLayout{.fourcc = V4L2_PIX_FMT_JPEG, .packing = Packing::Jpeg},
};

/// Returns null for formats that cannot be unpacked.
[[nodiscard]] inline const PixelLayout* layout_of(uint32_t fourcc) {
  for (const PixelLayout& layout : kLayouts)
    if (layout.fourcc == fourcc) return &layout;
  return nullptr;
}
/// Returns a name such as "YUYV", or "0x00000001" if the bytes are not printable.
[[nodiscard]] inline std::string fourcc_name(uint32_t fourcc) {
  std::string name;
  for (int shift = 0; shift < 32; shift += 8) name += static_cast<char>(fourcc >> shift & 0xFF);
  const bool printable = std::ranges::all_of(name, [](char c) { return c >= ' ' && c <= '~'; });
  if (!printable || name == "    ") return fmt::format("0x{:08x}", fourcc);
  return name.substr(0, name.find_last_not_of(' ') + 1);
}
/// Returns the layout of a name such as "YUYV"; null for others.
[[nodiscard]] inline const PixelLayout* layout_named(std::string_view name) {
  for (const PixelLayout& layout : kLayouts)
    if (fourcc_name(layout.fourcc) == name) return &layout;
  return nullptr;
}

/// PackedUnit is the shortest part of a row that holds whole pixels.
struct PackedUnit {
  int pixels;  ///< 1, or 2 that share their chroma
  int bytes;   ///< bytes of a unit in each plane
};
[[nodiscard]] constexpr PackedUnit unit_of(Packing packing) {
  constexpr PackedUnit kUnits[] = {{1, 1}, {1, 2}, {1, 1}, {2, 4}, {2, 2}, {1, 3}, {1, 0}};
  return kUnits[static_cast<size_t>(packing)];
}

/// Returns the bytes of one row of the first plane without padding; 0 for JPEG.
[[nodiscard]] inline size_t row_bytes(const PixelLayout& layout, int width) {
  const auto [pixels, bytes] = unit_of(layout.packing);
  return (static_cast<size_t>(width) + static_cast<size_t>(pixels) - 1) /
         static_cast<size_t>(pixels) * static_cast<size_t>(bytes);
}
/// Returns the bytes of a whole picture with rows of `bytes_per_line`, the last one without
/// padding; 0 for JPEG.
[[nodiscard]] inline size_t picture_bytes(const PixelLayout& layout, int width, int height,
                                          size_t bytes_per_line) {
  if (layout.packing == Packing::Jpeg) return 0;
  const int rows = layout.packing == Packing::Nv12 ? height + (height + 1) / 2 : height;
  return static_cast<size_t>(rows - 1) * bytes_per_line + row_bytes(layout, width);
}

/// RawFormat describes the memory layout of a picture and the coding of its samples.
struct RawFormat {
  uint32_t fourcc = 0;
  int width = 0;
  int height = 0;
  size_t bytes_per_line = 0;  ///< 0: rows without padding
  ColourCoding coding;
};

inline constexpr int kMaxSide = 16384;
inline constexpr int64_t kMaxPixels = int64_t{1} << 26;
inline constexpr size_t kMaxBytesPerLine = size_t{1} << 20;

[[noreturn]] inline void refuse_format(const std::string& camera, const std::string& cause) {
  throw device_error("{}: {}", camera, cause)
      .remedy("choose another format or size ('lenticule calibrate camera --list')");
}

/// Throws Error(Device) that names `camera` for a format that cannot be unpacked.
[[nodiscard]] inline PixelLayout require_layout(uint32_t fourcc, const std::string& camera) {
  const PixelLayout* const layout = layout_of(fourcc);
  if (layout == nullptr)
    refuse_format(camera, "pixel format " + fourcc_name(fourcc) + " is not known");
  return *layout;
}

/// Resolves what the driver left open. Throws Error(Device) that names `camera` for pictures of
/// size zero or an excessive size, and for rows that overlap or are implausibly long.
[[nodiscard]] inline RawFormat checked_format(RawFormat format, const PixelLayout& layout,
                                              const std::string& camera) {
  const int smallest = layout.packing == Packing::Bayer8 ? 2 : 1;
  if (format.width < smallest || format.height < smallest || format.width > kMaxSide ||
      format.height > kMaxSide || int64_t{format.width} * format.height > kMaxPixels)
    refuse_format(
        camera, fmt::format("pictures of {}x{} pixels; expected {}x{} to {}x{}, at most {} pixels",
                            format.width, format.height, smallest, smallest, kMaxSide, kMaxSide,
                            kMaxPixels));
  const size_t packed = row_bytes(layout, format.width);
  if (format.bytes_per_line == 0 || layout.packing == Packing::Jpeg) format.bytes_per_line = packed;
  if (format.bytes_per_line < packed || format.bytes_per_line > kMaxBytesPerLine)
    refuse_format(camera,
                  fmt::format("rows of {} bytes cannot hold {} pixels of {}", format.bytes_per_line,
                              format.width, fourcc_name(format.fourcc)));
  format.coding = resolved(format.coding, layout.samples());
  return format;
}

/// Returns the code scale. libjpeg-turbo's R'G'B' is full range, regardless of the driver's values.
[[nodiscard]] inline CodeScale scale_of(const RawFormat& format, const PixelLayout& layout) {
  if (layout.packing == Packing::Jpeg) return {.black = 0.0, .per_code = 1.0 / 255.0};
  return code_scale(format.coding, layout.bits);
}

/// Calls put(R, G, B) or put(Y, Cb, Cr) with the codes of each pixel of a row; Grey8 has its code
/// three times. Chroma is repeated, not interpolated. Not for Grey16, Bayer8 and JPEG. `bytes` hold
/// a whole picture.
template <class Put>
void each_pixel(const PixelLayout& layout, const RawFormat& format, std::span<const uint8_t> bytes,
                int y, const Put& put) {
  const auto row = [&](int number) {
    return bytes.data() + static_cast<size_t>(number) * format.bytes_per_line;
  };
  const auto [pixels, unit] = unit_of(layout.packing);
  const uint8_t* first = row(y) + layout.at[0];
  const uint8_t* others = row(layout.packing == Packing::Nv12 ? format.height + y / 2 : y);
  for (int x = 1; x <= format.width; ++x, first += unit / pixels) {
    put(*first, others[layout.at[1]], others[layout.at[2]]);
    if ((x & (pixels - 1)) == 0) others += unit;
  }
}

}  // namespace lenticule::frames::capture
