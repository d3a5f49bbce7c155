// SPDX-License-Identifier: Apache-2.0
// ScanoutLayout is the form of the frames in scan-out memory: one picture, or the pictures of
// several panels that are scanned out of one buffer.
#pragma once

#include <cstdint>
#include <vector>

#include "display/scanout_depth.h"
#include "frames/frame.h"
#include "optics/mounting.h"

namespace lenticule::display {

/// ScanoutPart is the place of one panel's picture in the buffer.
struct ScanoutPart {
  frames::FrameGeometry geometry{};  ///< size of the picture that is sent to the panel
  optics::Mounting mounting{};
  int left_px = 0;
  int top_px = 0;
  friend bool operator==(const ScanoutPart&, const ScanoutPart&) = default;
};

struct ScanoutLayout {
  frames::FrameGeometry geometry{};  ///< size of the picture that is sent, or of all parts together
  optics::Mounting mounting{};
  ScanoutDepth depth = ScanoutDepth::Bits8;
  /// The panels of a wall; empty for one panel. No two overlap.
  std::vector<ScanoutPart> parts{};

  /// Returns true if frames of this form fill the buffer: a whole picture, or a picture of the
  /// right size for each part.
  [[nodiscard]] bool takes(const frames::FrameView& frame) const noexcept;
};

/// Fills scan-out memory with a frame that the layout takes. `stride` is the number of words from
/// one row to the next. Pixels between the parts keep their values; no panel shows them.
void expand_frame(const ScanoutLayout& layout, const frames::FrameView& frame, uint32_t* words,
                  size_t stride) noexcept;

}  // namespace lenticule::display
