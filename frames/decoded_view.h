// SPDX-License-Identifier: Apache-2.0
// Decodes the views of a woven frame: the pictures seen by eyes that stand where each view is aimed
// at.
#pragma once

#include "frames/frame.h"
#include "optics/model.h"

namespace lenticule::frames {

/// Returns the eye on the viewing line at the middle of view `view` of `views`; 0 is the leftmost.
/// Rigs without a gap show the same picture everywhere, so their design eye is returned.
[[nodiscard]] optics::Eye eye_of_view(const optics::OpticalModel& model, int view, int views);

/// Returns one pixel per lens across, with square pixels: the resolution of a view of this sheet.
[[nodiscard]] FrameGeometry decoded_geometry(const optics::Rig& rig);

/// Returns the picture that the view's eye sees, at decoded_geometry(). Throws Error(Input) if the
/// frame does not have the panel's size.
[[nodiscard]] WovenFrame decode_view(const FrameView& woven, const optics::OpticalModel& model,
                                     int view, int views);

}  // namespace lenticule::frames
