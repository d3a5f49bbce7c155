// SPDX-License-Identifier: Apache-2.0
// turned_rig computes the rig of a panel that is hung in another way than the one in which it was
// measured.
#pragma once

#include "optics/rig.h"

namespace lenticule::optics {

/// Returns the rig for a viewer who sees the panel with this mounting. The panel, its sheet and its
/// residual map are turned from rig.panel.mounting; the viewing line, which belongs to the viewer,
/// stays. Every phase is kept except for its sign and rounding (in a quarter turn of a sheet with a
/// residual map, the map is read at points that differ by the channel offsets). Throws Error(Input)
/// if the lenses would lie across the viewer's eyes: beyond the slants that a rig can have.
[[nodiscard]] Rig turned_rig(const Rig& rig, const Mounting& mounting);

/// Returns the layout of a panel of size `sent` as seen with this mounting.
[[nodiscard]] SubpixelLayout turned_layout(const SubpixelLayout& layout, const Mounting& mounting,
                                           PixelGrid sent);

}  // namespace lenticule::optics
