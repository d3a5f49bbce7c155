// SPDX-License-Identifier: Apache-2.0
// Draws what an eye sees of a chart that is white for this eye only, to compare two rigs.
#pragma once

#include <string>

#include "optics/model.h"
#include "optics/rig.h"

namespace lenticule::web {

/// Returns the picture as JPEG. The chart is woven with the rig `woven`, and seen through the sheet
/// of the rig `seen`.
[[nodiscard]] std::string comb_picture(const optics::Rig& woven, const optics::Rig& seen,
                                       const optics::Eye& eye);

}  // namespace lenticule::web
