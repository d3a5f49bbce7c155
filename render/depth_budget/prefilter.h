// SPDX-License-Identifier: Apache-2.0
// Averages over what a lens shows of one subpixel, and how many rays they take.
//
// A lens shows an eye one colour all across, and that colour to every eye within the angle d that
// the subpixel spans. What a subpixel ought to show is the mean over its beam: all rays between
// those places on the lens and those eyes, over the height of the pixel. At depth z the beam is
// p_h |1 - z / Z| wide by the lens and |z| d by the subpixel: boxes that are folded with each
// other. The height of a pixel of size a under a lens of slant m adds a third, m a |1 + z d / s|
// wide with s the width of a subpixel on the panel: further down, the same pixel lies elsewhere
// under its lens. Within the depth of field the lens is the widest of the three, beyond it the
// subpixel or, at slants of more than a third, the height.
#pragma once

#include <string>
#include <vector>

#include "render/options/render_options.h"
#include "render/rays/footprint.h"

namespace lenticule::render {

/// "off", "depth", "beam" or "exhaustive"; throws Error(Usage) otherwise.
[[nodiscard]] Prefilter prefilter_named(const std::string& name);

/// Places inside a subpixel's beam that stand for all of it alike: evenly over the subpixel's width
/// in the first place, and over its height and across the lens. For each there is one as far on the
/// other side of the middle, and the first is the middle. `count` is odd; of an even one, one less.
[[nodiscard]] std::vector<SubpixelPlace> beam_samples(int count);

/// Rays over the beam for what lies at `depth` depths of field from the glass: two for each lens
/// pitch that the beam is wide, rounded up to 2^k + 1, but no more than `most`.
[[nodiscard]] int beam_rays(double depth, int most);

}  // namespace lenticule::render
