// SPDX-License-Identifier: Apache-2.0
// Converts a frame woven for one rig to another rig: decodes the frame into views and weaves them
// again.
#pragma once

#include "frames/frame.h"
#include "frames/quilt.h"
#include "optics/model.h"

namespace lenticule::frames {

/// Returns the number of whole subpixels under a lens, which is the number of views in the frame.
/// At least 2.
[[nodiscard]] int views_in_woven(const optics::Rig& rig);

/// Decodes a woven frame: view k of `views` is the picture that an eye in the middle of that part
/// of the rig's lobe sees, one pixel per lens, with the panel's aspect. View k of one rig's lobe
/// becomes view k of the other's, as with quilts. Throws Error(Input) if the frame does not have
/// the panel's size.
[[nodiscard]] ViewSet views_of_woven(const FrameView& woven, const optics::OpticalModel& model,
                                     int views);

}  // namespace lenticule::frames
