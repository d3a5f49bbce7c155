// SPDX-License-Identifier: Apache-2.0
// Averages over the beam that a lens shows of one subpixel, and the number of rays for them.
//
// A lens shows an eye one colour across its whole width, and shows that colour to every eye within
// the angle d that the subpixel subtends. The correct colour of a subpixel is the mean over its
// beam: all rays between these places on the lens and these eyes, over the height of the pixel. At
// depth z the lens makes the beam p_h |1 - z / Z| wide and the subpixel makes it |z| d wide; the
// two box filters are convolved. The height of a pixel of size a under a lens of slant m adds a
// third box of width m a |1 + z d / s|, where s is the width of a subpixel on the panel: lower
// parts of a pixel lie elsewhere under its lens. Within the depth of field the lens's box is the
// widest of the three; beyond it the subpixel's box or, at slants of more than a third, the
// height's.
#pragma once

#include <string>
#include <vector>

#include "render/options/render_options.h"
#include "render/rays/footprint.h"

namespace lenticule::render {

/// Parses "off", "depth", "beam" or "exhaustive"; throws Error(Usage) for any other name.
[[nodiscard]] Prefilter prefilter_named(const std::string& name);

/// Returns places inside a subpixel's beam that represent it with equal weights. They are spread
/// evenly, foremost over the subpixel's width, and also over its height and across the lens. The
/// first place is the centre; the others come in pairs symmetric about it. `count` should be odd;
/// an even count is reduced by one.
[[nodiscard]] std::vector<SubpixelPlace> beam_samples(int count);

/// Returns the number of rays over the beam for content at `depth` depths of field from the panel:
/// two per lens pitch of the beam's width, rounded up to 2^k + 1, but at most `most`.
[[nodiscard]] int beam_rays(double depth, int most);

}  // namespace lenticule::render
