// SPDX-License-Identifier: Apache-2.0
// From which places a frame is predicted best: measured on the frame itself, so that a lens sheet
// need not be known, and views or quilts compress as well.
#pragma once

#include "frames/frame.h"
#include "frames/sequence/tap_kernel.h"

namespace lenticule::frames {

/// At most kMaxTaps places, the most useful first. Looks at a fixed sample of the blocks: the same
/// frame gives the same taps on every machine. `band_rows` as in the container.
[[nodiscard]] TapTable choose_taps(const FrameView& frame, int band_rows);

}  // namespace lenticule::frames
