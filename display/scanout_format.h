// SPDX-License-Identifier: Apache-2.0
// Converts RGB bytes to and from XRGB8888 words (B, G, R, 0 in memory) without changing a subpixel.
// XRGB8888 is the one format that every display accepts.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/cpu.h"
#include "frames/frame.h"
#include "optics/mounting.h"

namespace lenticule::display {

/// Converts RGB to XRGB. `rgb` holds 3 * pixels bytes, `xrgb` pixels words; the X byte becomes 0.
/// Runs on best_isa().
void expand_row(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept;
/// Converts XRGB to RGB; ignores the X byte.
void pack_row(const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept;

/// Fills scan-out memory with the picture that a viewer sees as `frame` on a panel with this
/// mounting. `stride` is the number of words from one row to the next. Runs on best_isa().
void expand_frame(const frames::FrameView& frame, const optics::Mounting& mounting, uint32_t* xrgb,
                  size_t stride) noexcept;

/// Same with the given instruction set, or the best below it that the machine has.
void expand_row(Isa isa, const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept;
void pack_row(Isa isa, const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept;
void expand_frame(Isa isa, const frames::FrameView& frame, const optics::Mounting& mounting,
                  uint32_t* xrgb, size_t stride) noexcept;

/// Returns the geometry of the frames that a viewer sees on scan-out memory of this geometry, and
/// the other way round.
[[nodiscard]] frames::FrameGeometry turned(frames::FrameGeometry geometry,
                                           const optics::Mounting& mounting);

}  // namespace lenticule::display
