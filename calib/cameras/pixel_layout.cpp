// SPDX-License-Identifier: Apache-2.0
#include "calib/cameras/pixel_layout.h"

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <array>

namespace lenticule::calib {
namespace {

constexpr std::array kLayouts{
    PixelLayout{.fourcc = V4L2_PIX_FMT_GREY},
    PixelLayout{.fourcc = V4L2_PIX_FMT_Y16, .packing = Packing::Grey16, .bits = 16},
    PixelLayout{.fourcc = V4L2_PIX_FMT_Y12, .packing = Packing::Grey16, .bits = 12},
    PixelLayout{.fourcc = V4L2_PIX_FMT_Y10, .packing = Packing::Grey16, .bits = 10},
    PixelLayout{.fourcc = V4L2_PIX_FMT_SRGGB8, .packing = Packing::Bayer8},
    PixelLayout{.fourcc = V4L2_PIX_FMT_SGRBG8, .packing = Packing::Bayer8, .red_column = 1},
    PixelLayout{
        .fourcc = V4L2_PIX_FMT_SBGGR8, .packing = Packing::Bayer8, .red_column = 1, .red_row = 1},
    PixelLayout{.fourcc = V4L2_PIX_FMT_SGBRG8, .packing = Packing::Bayer8, .red_row = 1},
    PixelLayout{.fourcc = V4L2_PIX_FMT_YUYV, .packing = Packing::Yuv422},
    PixelLayout{
        .fourcc = V4L2_PIX_FMT_UYVY, .packing = Packing::Yuv422, .luma_byte = 1, .chroma_byte = 0},
    PixelLayout{.fourcc = V4L2_PIX_FMT_NV12, .packing = Packing::Nv12},
    PixelLayout{.fourcc = V4L2_PIX_FMT_RGB24, .packing = Packing::Rgb},
    PixelLayout{.fourcc = V4L2_PIX_FMT_BGR24, .packing = Packing::Rgb, .red_byte = 2},
    PixelLayout{.fourcc = V4L2_PIX_FMT_MJPEG, .packing = Packing::Jpeg},
    PixelLayout{.fourcc = V4L2_PIX_FMT_JPEG, .packing = Packing::Jpeg},
};

size_t half_up(int count) {
  return (static_cast<size_t>(count) + 1) / 2;
}

}  // namespace

Samples PixelLayout::samples() const {
  if (channels() == 1) return Samples::Luma;
  return packing == Packing::Yuv422 || packing == Packing::Nv12 ? Samples::Ycbcr : Samples::Rgb;
}

std::span<const PixelLayout> supported_layouts() {
  return kLayouts;
}

const PixelLayout* layout_of(uint32_t fourcc) {
  for (const PixelLayout& layout : kLayouts)
    if (layout.fourcc == fourcc) return &layout;
  return nullptr;
}

const PixelLayout* layout_named(std::string_view name) {
  for (const PixelLayout& layout : kLayouts)
    if (fourcc_name(layout.fourcc) == name) return &layout;
  return nullptr;
}

std::string fourcc_name(uint32_t fourcc) {
  std::string name;
  for (int shift = 0; shift < 32; shift += 8) name += static_cast<char>(fourcc >> shift & 0xFF);
  const bool printable =
      std::all_of(name.begin(), name.end(), [](char c) { return c >= ' ' && c <= '~'; });
  if (!printable || name == "    ") return fmt::format("0x{:08x}", fourcc);
  return name.substr(0, name.find_last_not_of(' ') + 1);
}

size_t row_bytes(const PixelLayout& layout, int width) {
  const auto columns = static_cast<size_t>(width);
  switch (layout.packing) {
    case Packing::Grey8:
    case Packing::Bayer8:
      return columns;
    case Packing::Grey16:
      return columns * 2;
    case Packing::Yuv422:
      return half_up(width) * 4;
    case Packing::Nv12:
      return half_up(width) * 2;
    case Packing::Rgb:
      return columns * 3;
    case Packing::Jpeg:
      break;
  }
  return 0;
}

size_t picture_bytes(const PixelLayout& layout, int width, int height, size_t bytes_per_line) {
  if (layout.packing == Packing::Jpeg) return 0;
  size_t rows = static_cast<size_t>(height);
  if (layout.packing == Packing::Nv12) rows += half_up(height);
  return (rows - 1) * bytes_per_line + row_bytes(layout, width);
}

}  // namespace lenticule::calib
