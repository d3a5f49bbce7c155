// SPDX-License-Identifier: Apache-2.0
#include "calib/cameras/pixel_unpack.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "calib/cameras/bayer.h"

namespace lenticule::calib {
namespace {

constexpr int kMaxSide = 16384;
constexpr int64_t kMaxPixels = int64_t{1} << 26;
constexpr size_t kMaxBytesPerLine = size_t{1} << 20;

[[noreturn]] void refuse(const std::string& camera, const std::string& cause) {
  throw Error(ErrorKind::Device, camera + ": " + cause,
              "choose another format or size ('lenticule calibrate camera --list')");
}

PixelLayout require_layout(uint32_t fourcc, const std::string& camera) {
  const PixelLayout* const layout = layout_of(fourcc);
  if (layout == nullptr) refuse(camera, "pixel format " + fourcc_name(fourcc) + " is not known");
  return *layout;
}

RawFormat checked_format(RawFormat format, const PixelLayout& layout, const std::string& camera) {
  const int smallest = layout.packing == Packing::Bayer8 ? 2 : 1;
  if (format.width < smallest || format.height < smallest || format.width > kMaxSide ||
      format.height > kMaxSide || int64_t{format.width} * format.height > kMaxPixels)
    refuse(camera, fmt::format("pictures of {}x{} cannot be used", format.width, format.height));
  const size_t packed = row_bytes(layout, format.width);
  if (format.bytes_per_line == 0 || layout.packing == Packing::Jpeg) format.bytes_per_line = packed;
  if (format.bytes_per_line < packed || format.bytes_per_line > kMaxBytesPerLine)
    refuse(camera, fmt::format("rows of {} bytes cannot hold {} pixels of {}",
                               format.bytes_per_line, format.width, fourcc_name(format.fourcc)));
  format.coding = resolved(format.coding, layout.samples());
  return format;
}

/// Returns the code scale. libjpeg-turbo's R'G'B' is full range, regardless of the driver's values.
CodeScale scale_of(const RawFormat& format, const PixelLayout& layout) {
  if (layout.packing == Packing::Jpeg) return {.black = 0.0, .per_code = 1.0 / 255.0};
  return code_scale(format.coding, layout.bits);
}

}  // namespace

PixelUnpacker::PixelUnpacker(const RawFormat& format, const std::string& camera)
    : layout_(require_layout(format.fourcc, camera)),
      format_(checked_format(format, layout_, camera)),
      bytes_needed_(picture_bytes(layout_, format_.width, format_.height, format_.bytes_per_line)),
      curve_(format_.coding.xfer_func),
      matrix_(ycbcr_matrix(format_.coding)) {
  const CodeScale scale = scale_of(format_, layout_);
  wide_black_ = static_cast<float>(scale.black);
  wide_per_code_ = static_cast<float>(scale.per_code);
  for (size_t code = 0; code < 256; ++code) {
    const auto value = static_cast<double>(code);
    encoded_of_luma_[code] = static_cast<float>((value - scale.black) * scale.per_code);
    const double held = std::clamp((value - scale.black) * scale.per_code, 0.0, 1.0);
    light_of_code_[code] = static_cast<float>(linear_by_formula(format_.coding.xfer_func, held));
    chroma_of_code_[code] =
        static_cast<float>((value - scale.chroma_middle) * scale.chroma_per_code);
  }
  if (layout_.packing == Packing::Jpeg) jpeg_.emplace();
}

bool PixelUnpacker::unpack(std::span<const uint8_t> bytes, CameraPicture& out) {
  if (bytes.size() < bytes_needed_) return false;
  out.width = format_.width;
  out.height = format_.height;
  out.channels = channels();
  out.light.resize(static_cast<size_t>(out.width) * static_cast<size_t>(out.height) *
                   static_cast<size_t>(out.channels));
  switch (layout_.packing) {
    case Packing::Grey8:
      unpack_grey8(bytes, out.light);
      return true;
    case Packing::Grey16:
      unpack_grey16(bytes, out.light);
      return true;
    case Packing::Bayer8:
      unpack_bayer(bytes, out.light);
      return true;
    case Packing::Yuv422:
      unpack_yuv422(bytes, out.light);
      return true;
    case Packing::Nv12:
      unpack_nv12(bytes, out.light);
      return true;
    case Packing::Rgb:
      unpack_rgb(bytes, out.light);
      return true;
    case Packing::Jpeg:
      break;
  }
  return unpack_jpeg(bytes, out.light);
}

const uint8_t* PixelUnpacker::row(std::span<const uint8_t> bytes, int y) const {
  return bytes.data() + static_cast<size_t>(y) * format_.bytes_per_line;
}

void PixelUnpacker::unpack_grey8(std::span<const uint8_t> bytes, std::span<float> light) const {
  float* out = light.data();
  for (int y = 0; y < format_.height; ++y) {
    const uint8_t* const codes = row(bytes, y);
    for (int x = 0; x < format_.width; ++x) *out++ = light_of_code_[codes[x]];
  }
}

void PixelUnpacker::unpack_grey16(std::span<const uint8_t> bytes, std::span<float> light) const {
  float* out = light.data();
  for (int y = 0; y < format_.height; ++y) {
    const uint8_t* codes = row(bytes, y);
    for (int x = 0; x < format_.width; ++x, codes += 2) {
      const auto code = static_cast<float>(codes[0] | codes[1] << 8);
      *out++ = curve_((code - wide_black_) * wide_per_code_);
    }
  }
}

void PixelUnpacker::unpack_bayer(std::span<const uint8_t> bytes, std::span<float> light) {
  mosaic_.resize(static_cast<size_t>(format_.width) * static_cast<size_t>(format_.height));
  unpack_grey8(bytes, mosaic_);
  interpolate_bayer(mosaic_, format_.width, format_.height,
                    {.red_column = layout_.red_column, .red_row = layout_.red_row}, light);
}

void PixelUnpacker::put_ycbcr(uint8_t luma, uint8_t cb, uint8_t cr, float* rgb) const {
  const float y = encoded_of_luma_[luma];
  const float blue = chroma_of_code_[cb];
  const float red = chroma_of_code_[cr];
  rgb[0] = curve_(y + static_cast<float>(matrix_.red_cr) * red);
  rgb[1] = curve_(y + static_cast<float>(matrix_.green_cb) * blue +
                  static_cast<float>(matrix_.green_cr) * red);
  rgb[2] = curve_(y + static_cast<float>(matrix_.blue_cb) * blue);
}

void PixelUnpacker::unpack_yuv422(std::span<const uint8_t> bytes, std::span<float> light) const {
  float* out = light.data();
  for (int y = 0; y < format_.height; ++y) {
    const uint8_t* const codes = row(bytes, y);
    for (int x = 0; x < format_.width; ++x, out += 3) {
      const uint8_t* const pair = codes + static_cast<ptrdiff_t>(x / 2) * 4;
      const uint8_t luma = pair[layout_.luma_byte + 2 * (x & 1)];
      put_ycbcr(luma, pair[layout_.chroma_byte], pair[layout_.chroma_byte + 2], out);
    }
  }
}

void PixelUnpacker::unpack_nv12(std::span<const uint8_t> bytes, std::span<float> light) const {
  float* out = light.data();
  for (int y = 0; y < format_.height; ++y) {
    const uint8_t* const luma = row(bytes, y);
    const uint8_t* const chroma = row(bytes, format_.height + y / 2);
    for (int x = 0; x < format_.width; ++x, out += 3) {
      const uint8_t* const pair = chroma + static_cast<ptrdiff_t>(x / 2) * 2;
      put_ycbcr(luma[x], pair[0], pair[1], out);
    }
  }
}

void PixelUnpacker::unpack_rgb(std::span<const uint8_t> bytes, std::span<float> light) const {
  float* out = light.data();
  for (int y = 0; y < format_.height; ++y) {
    const uint8_t* codes = row(bytes, y);
    for (int x = 0; x < format_.width; ++x, codes += 3, out += 3) {
      out[0] = light_of_code_[codes[layout_.red_byte]];
      out[1] = light_of_code_[codes[1]];
      out[2] = light_of_code_[codes[2 - layout_.red_byte]];
    }
  }
}

bool PixelUnpacker::unpack_jpeg(std::span<const uint8_t> bytes, std::span<float> light) {
  const std::span<const uint8_t> rgb = jpeg_->decode(bytes, format_.width, format_.height);
  if (rgb.size() != light.size()) return false;
  std::transform(rgb.begin(), rgb.end(), light.begin(),
                 [this](uint8_t code) { return light_of_code_[code]; });
  return true;
}

}  // namespace lenticule::calib
