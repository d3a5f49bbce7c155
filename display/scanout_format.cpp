// SPDX-License-Identifier: Apache-2.0
#include "display/scanout_format.h"

#include <algorithm>

#include "display/scanout_kernel.h"

namespace lenticule::display {
namespace {

const ScanoutLoops& loops_of(Isa isa, ScanoutDepth depth) noexcept {
  return LENTICULE_SELECT_KERNEL(isa, kScanoutKernel).loops(depth);
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

bool fits(const frames::FrameView& frame, const optics::Mounting& mounting,
          const frames::FrameGeometry& sent) noexcept {
  return turned(frame.geometry, mounting) == sent && frame.bytes.size() >= sent.frame_bytes();
}

}  // namespace

void expand_row(ScanoutDepth depth, const uint8_t* rgb, uint32_t* words, size_t pixels,
                Isa isa) noexcept {
  loops_of(isa, depth).expand_row(rgb, words, pixels);
}

void pack_row(ScanoutDepth depth, const uint32_t* words, uint8_t* rgb, size_t pixels,
              Isa isa) noexcept {
  loops_of(isa, depth).pack_row(words, rgb, pixels);
}

void expand_frame(ScanoutDepth depth, const frames::FrameView& frame,
                  const optics::Mounting& mounting, uint32_t* words, size_t stride,
                  Isa isa) noexcept {
  const ScanoutLoops& loops = loops_of(isa, depth);
  const frames::FrameGeometry sent = turned(frame.geometry, mounting);
  const auto width = static_cast<size_t>(sent.width), height = static_cast<size_t>(sent.height);
  if (mounting.upright()) {
    for (size_t j = 0; j < height; ++j)
      loops.expand_row(frame.row(static_cast<int>(j)), words + j * stride, width);
    return;
  }
  const TurnedPixels pixels = turned_pixels(frame, mounting);
  for (size_t j = 0; j < height; j += kTurnedTile)
    for (size_t i = 0; i < width; i += kTurnedTile)
      loops.expand_turned(pixels.from(i, j), words + j * stride + i, stride,
                          std::min(kTurnedTile, width - i), std::min(kTurnedTile, height - j));
}

frames::FrameGeometry turned(frames::FrameGeometry geometry, const optics::Mounting& mounting) {
  const optics::PixelGrid size = mounting.turned({geometry.width, geometry.height});
  geometry.width = size.width;
  geometry.height = size.height;
  return geometry;
}

bool ScanoutLayout::takes(const frames::FrameView& frame) const noexcept {
  if (frame.parts.empty()) return fits(frame, mounting, geometry);
  if (frame.parts.size() != parts.size()) return false;
  for (size_t n = 0; n < parts.size(); ++n)
    if (!fits(frame.parts[n], parts[n].mounting, parts[n].geometry)) return false;
  return true;
}

void expand_frame(const ScanoutLayout& layout, const frames::FrameView& frame, uint32_t* words,
                  size_t stride) noexcept {
  if (frame.parts.empty()) return expand_frame(layout.depth, frame, layout.mounting, words, stride);
  for (size_t n = 0; n < layout.parts.size(); ++n) {
    const ScanoutPart& part = layout.parts[n];
    uint32_t* const corner =
        words + static_cast<size_t>(part.top_px) * stride + static_cast<size_t>(part.left_px);
    expand_frame(layout.depth, frame.parts[n], part.mounting, corner, stride);
  }
}

void expand_box(const ScanoutLayout& layout, const frames::FrameView& box, int left, int top,
                size_t part, uint32_t* words, size_t stride) noexcept {
  const ScanoutPart place =
      layout.parts.empty() ? ScanoutPart{.geometry = layout.geometry, .mounting = layout.mounting}
                           : layout.parts[part];
  const auto sent = [&place](int column, int row) {
    return place.mounting.inverse().seen_place({column, row},
                                               {place.geometry.width, place.geometry.height});
  };
  const optics::PixelPlace a = sent(left, top);
  const optics::PixelPlace b = sent(left + box.geometry.width - 1, top + box.geometry.height - 1);
  words += static_cast<size_t>(place.top_px + std::min(a.row, b.row)) * stride +
           static_cast<size_t>(place.left_px + std::min(a.column, b.column));
  expand_frame(layout.depth, box, place.mounting, words, stride);
}

}  // namespace lenticule::display
