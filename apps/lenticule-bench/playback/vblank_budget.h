// SPDX-License-Identifier: Apache-2.0
// What a 4K frame costs one core from the file to the glass, beside the time between two vblanks.
#pragma once

#include <nlohmann/json.hpp>

#include "optics/rig.h"

namespace lenticule::player {

/// Renders one frame of the demo scene for `rig` and measures, `runs` times by turns and in
/// processor time of this thread: decoding it, decoding its views, weaving them, and copying a
/// frame into a scanout buffer. An array of rows: {"source", "decode_ms", "weave_ms", "copy_ms",
/// "total_ms", "part_of_vblank"}; null where a source has no such step. Medians. Shorter when
/// interrupted.
[[nodiscard]] nlohmann::json measure_vblank_budget(const optics::Rig& rig, int runs);
void print_vblank_budget(const nlohmann::json& rows);

}  // namespace lenticule::player
