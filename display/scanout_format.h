// SPDX-License-Identifier: Apache-2.0
// Converts frames, whose subpixels have 8 bits, to and from the words of scan-out memory.
//
// XRGB8888 (B, G, R, 0 in memory) holds each subpixel unchanged; every display accepts it.
// XRGB2101010 holds v * 1023 / 255, rounded, for a subpixel v: black stays black, full intensity
// stays full, and equal steps of v differ by at most one code of 1023. Its upper eight bits are v,
// so that no subpixel is lost.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/cpu.h"
#include "display/scanout_depth.h"
#include "frames/frame.h"
#include "optics/panel.h"

namespace lenticule::display {

/// Converts a row. `rgb` holds 3 * pixels bytes, `words` as many words as pixels; their unused bits
/// become 0. All functions take the best instruction set up to `isa` that the machine has.
void expand_row(ScanoutDepth depth, const uint8_t* rgb, uint32_t* words, size_t pixels,
                Isa isa = best_isa()) noexcept;
/// Converts words to RGB; ignores the unused bits.
void pack_row(ScanoutDepth depth, const uint32_t* words, uint8_t* rgb, size_t pixels,
              Isa isa = best_isa()) noexcept;

/// Fills scan-out memory with the picture that a viewer sees as `frame` on a panel with this
/// mounting. `stride` is the number of words from one row to the next.
void expand_frame(ScanoutDepth depth, const frames::FrameView& frame,
                  const optics::Mounting& mounting, uint32_t* words, size_t stride,
                  Isa isa = best_isa()) noexcept;

/// Returns the geometry of the frames that a viewer sees on scan-out memory of this geometry, and
/// the other way round.
[[nodiscard]] frames::FrameGeometry turned(frames::FrameGeometry geometry,
                                           const optics::Mounting& mounting);

/// ScanoutPart is the place of one panel's picture in the buffer.
struct ScanoutPart {
  frames::FrameGeometry geometry{};  ///< size of the picture that is sent to the panel
  optics::Mounting mounting{};
  int left_px = 0;
  int top_px = 0;
  friend bool operator==(const ScanoutPart&, const ScanoutPart&) = default;
};

/// ScanoutLayout is the form of the frames in scan-out memory: one picture, or the pictures of
/// several panels that are scanned out of one buffer.
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
/// Fills a part of it as ScanoutBuffer::fill_box() does.
void expand_box(const ScanoutLayout& layout, const frames::FrameView& box, int left, int top,
                size_t part, uint32_t* words, size_t stride) noexcept;

}  // namespace lenticule::display
