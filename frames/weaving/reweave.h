// SPDX-License-Identifier: Apache-2.0
// A frame that was woven for one rig, for another: taken apart into views and woven again.
#pragma once

#include "frames/frame.h"
#include "frames/quilt.h"
#include "optics/model.h"

namespace lenticule::frames {

/// As many views as whole subpixels lie under a lens: there is not more in the frame. At least 2.
[[nodiscard]] int views_in_woven(const optics::Rig& rig);

/// Takes a woven frame apart: view k of `views` is what an eye in the middle of that part of the
/// rig's lobe sees, one pixel per lens, with the panel's aspect. View k of one rig's lobe becomes
/// view k of the other's, as with quilts. Throws Error(Input) if the frame is not the panel's.
[[nodiscard]] ViewSet views_of_woven(const FrameView& woven, const optics::OpticalModel& model,
                                     int views);

}  // namespace lenticule::frames
