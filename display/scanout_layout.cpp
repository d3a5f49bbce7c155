// SPDX-License-Identifier: Apache-2.0
#include "display/scanout_layout.h"

#include "display/scanout_format.h"

namespace lenticule::display {
namespace {

bool fits(const frames::FrameView& frame, const optics::Mounting& mounting,
          const frames::FrameGeometry& sent) noexcept {
  return turned(frame.geometry, mounting) == sent && frame.bytes.size() >= sent.frame_bytes();
}

}  // namespace

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

}  // namespace lenticule::display
