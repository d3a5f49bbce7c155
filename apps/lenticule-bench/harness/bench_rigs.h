// SPDX-License-Identifier: Apache-2.0
// The rigs that benchmarks measure with.
#pragma once

#include <string>

#include "optics/rig.h"

namespace lenticule::player {

/// The rig that benchmarks use unless told otherwise: the 4K kiosk of the sample rigs.
[[nodiscard]] optics::Rig kiosk_rig();
/// The classic integral image of the sample rigs: 64 upright lenses of eight whole pixels.
[[nodiscard]] optics::Rig paper_rig();
/// A panel of the same size with pixels `factor` times as wide and high, and lenses of as many
/// subpixels on a sheet that is thicker in proportion: the same viewing zones. For factor 1 the
/// same.
[[nodiscard]] optics::Rig coarser_rig(const optics::Rig& rig, int factor);
/// `file`, or kiosk_rig() if it is empty.
[[nodiscard]] optics::Rig bench_rig(const std::string& file);

}  // namespace lenticule::player
