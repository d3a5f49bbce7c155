// SPDX-License-Identifier: Apache-2.0
// Makes the pictures of the window: what two eyes see of a sent picture, in one picture.
#pragma once

#include <cstdint>
#include <vector>

#include "apps/lenticule-window/eye_pair.h"
#include "frames/frame.h"

namespace lenticule::window {

enum class Look {
  SideBySide,  ///< the left eye's picture on the left, the right eye's on the right
  Anaglyph,    ///< the left eye's red, the right eye's green and blue: for red-cyan glasses
};

/// Returns the woven frame that a viewer sees of the picture of XRGB words that was sent to the
/// panel.
[[nodiscard]] frames::WovenFrame seen_frame(const std::vector<uint32_t>& sent,
                                            const optics::Panel& panel);

/// Returns the largest size of one eye's picture that fits into the window with the panel's aspect.
[[nodiscard]] optics::PixelGrid eye_size(const optics::Panel& panel, Look look,
                                         optics::PixelGrid window);

/// Returns the window's picture; black where the eyes' pictures leave room.
[[nodiscard]] frames::WovenFrame window_picture(const optics::OpticalModel& model,
                                                const frames::WovenFrame& woven,
                                                const EyePair& eyes, Look look,
                                                optics::PixelGrid window);

}  // namespace lenticule::window
