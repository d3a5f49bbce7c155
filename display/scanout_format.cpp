// SPDX-License-Identifier: Apache-2.0
#include "display/scanout_format.h"

#include <algorithm>

#include "display/scanout_kernel.h"

namespace lenticule::display {
namespace {

const ScanoutKernel& best_kernel() noexcept {
  static const ScanoutKernel& kernel = LENTICULE_SELECT_KERNEL(best_isa(), kScanoutKernel);
  return kernel;
}

TurnedPixels turned_pixels(const frames::FrameView& frame, const optics::Mounting& mounting) {
  const optics::PixelGrid seen{frame.geometry.width, frame.geometry.height};
  const auto address = [&](optics::PixelPlace sent) {
    const optics::PixelPlace at = mounting.seen_place(sent, seen);
    return static_cast<ptrdiff_t>(at.row) * static_cast<ptrdiff_t>(frame.geometry.row_bytes()) +
           ptrdiff_t{3} * at.column;
  };
  const ptrdiff_t first = address({0, 0});
  return {frame.bytes.data() + first, address({1, 0}) - first, address({0, 1}) - first};
}

void expand_frame(const ScanoutKernel& kernel, const frames::FrameView& frame,
                  const optics::Mounting& mounting, uint32_t* xrgb, size_t stride) noexcept {
  const frames::FrameGeometry sent = turned(frame.geometry, mounting);
  const auto width = static_cast<size_t>(sent.width), height = static_cast<size_t>(sent.height);
  if (mounting.upright()) {
    for (size_t j = 0; j < height; ++j)
      kernel.expand_row(frame.row(static_cast<int>(j)), xrgb + j * stride, width);
    return;
  }
  const TurnedPixels pixels = turned_pixels(frame, mounting);
  for (size_t j = 0; j < height; j += kTurnedTile)
    for (size_t i = 0; i < width; i += kTurnedTile)
      kernel.expand_turned(pixels.from(i, j), xrgb + j * stride + i, stride,
                           std::min(kTurnedTile, width - i), std::min(kTurnedTile, height - j));
}

}  // namespace

void expand_row(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept {
  best_kernel().expand_row(rgb, xrgb, pixels);
}

void pack_row(const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept {
  best_kernel().pack_row(xrgb, rgb, pixels);
}

void expand_frame(const frames::FrameView& frame, const optics::Mounting& mounting, uint32_t* xrgb,
                  size_t stride) noexcept {
  expand_frame(best_kernel(), frame, mounting, xrgb, stride);
}

void expand_row(Isa isa, const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept {
  LENTICULE_SELECT_KERNEL(isa, kScanoutKernel).expand_row(rgb, xrgb, pixels);
}

void pack_row(Isa isa, const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept {
  LENTICULE_SELECT_KERNEL(isa, kScanoutKernel).pack_row(xrgb, rgb, pixels);
}

void expand_frame(Isa isa, const frames::FrameView& frame, const optics::Mounting& mounting,
                  uint32_t* xrgb, size_t stride) noexcept {
  expand_frame(LENTICULE_SELECT_KERNEL(isa, kScanoutKernel), frame, mounting, xrgb, stride);
}

frames::FrameGeometry turned(frames::FrameGeometry geometry, const optics::Mounting& mounting) {
  const optics::PixelGrid size = mounting.turned({geometry.width, geometry.height});
  geometry.width = size.width;
  geometry.height = size.height;
  return geometry;
}

}  // namespace lenticule::display
