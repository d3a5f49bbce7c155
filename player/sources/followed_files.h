// SPDX-License-Identifier: Apache-2.0
// marks_of_source records the state of a source's files, so that a replaced source can be played
// again.
#pragma once

#include <vector>

#include "base/file_mark.h"
#include "player/sources/source_spec.h"

namespace lenticule::player {

/// Returns the state of every file of a source and its sidecar; for a pattern, of the first 256
/// files, and their number. Empty for rings and for sources generated here. Costs one stat() per
/// file.
[[nodiscard]] std::vector<FileMark> marks_of_source(const SourceSpec& source);

}  // namespace lenticule::player
