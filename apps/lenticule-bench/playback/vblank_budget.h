// SPDX-License-Identifier: Apache-2.0
// Measures the processor time of a 4K frame on one core, from the file to the scan-out buffer,
// relative to the time between two vblanks.
#pragma once

#include <nlohmann/json.hpp>

#include "optics/rig.h"

namespace lenticule::bench {

/// Renders one frame of the demo scene for `rig` and measures, in `runs` interleaved runs and in
/// processor time of this thread: decoding it, decoding its views, weaving them, and copying a
/// frame into a scan-out buffer. Returns an array of rows: {"source", "decode_ms", "weave_ms",
/// "copy_ms", "total_ms", "part_of_vblank"}; null if a source has no such step. Values are medians.
/// The array is shorter when interrupted.
[[nodiscard]] nlohmann::json measure_vblank_budget(const optics::Rig& rig, int runs);
void print_vblank_budget(const nlohmann::json& rows);

}  // namespace lenticule::bench
