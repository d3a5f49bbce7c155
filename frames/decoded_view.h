// SPDX-License-Identifier: Apache-2.0
// The views of a woven frame as pictures: what eyes see who stand where each view is aimed at.
#pragma once

#include "frames/frame.h"
#include "optics/model.h"

namespace lenticule::frames {

/// The eye on the viewing line at the middle of view `view` of `views`; 0 is the leftmost. Rigs
/// without a gap show the same everywhere: their design eye.
[[nodiscard]] optics::Eye eye_of_view(const optics::OpticalModel& model, int view, int views);

/// One pixel per lens across, square pixels: as much as a view of this sheet holds.
[[nodiscard]] FrameGeometry decoded_geometry(const optics::Rig& rig);

/// What that eye sees, at decoded_geometry(). Throws Error(Input) if the frame is not the panel's.
[[nodiscard]] WovenFrame decode_view(const FrameView& woven, const optics::OpticalModel& model,
                                     int view, int views);

}  // namespace lenticule::frames
