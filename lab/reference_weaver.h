// SPDX-License-Identifier: Apache-2.0
// The reference implementation of weaving: scalar, in double precision, one subpixel after the
// other. FastWeaver must agree with it.
#pragma once

#include "frames/frame.h"
#include "frames/quilt.h"
#include "frames/weave.h"
#include "optics/model.h"

namespace lenticule::lab {

/// Weaves one set of views for one rig. Each subpixel takes its own channel of the point where its
/// ray crosses the panel (views are off-axis cameras focused on the panel), bilinear inside each
/// view and mixed in linear light, as an eye's retina does. If a single pixel contributes, its code
/// value is kept exactly.
[[nodiscard]] frames::WovenFrame weave(const frames::ViewSet& views,
                                       const optics::OpticalModel& model,
                                       const frames::WeaveOptions& options = {});

/// The same for rows [begin, end) of a frame of the panel's size; all other rows stay as they are.
void weave_rows(const frames::ViewSet& views, const optics::OpticalModel& model,
                const frames::WeaveOptions& options, int begin, int end, frames::WovenFrame& frame);

}  // namespace lenticule::lab
