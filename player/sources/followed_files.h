// SPDX-License-Identifier: Apache-2.0
// The files that a source is made of, so that a source that is replaced can be played anew.
#pragma once

#include <string>
#include <vector>

#include "base/file_mark.h"
#include "player/sources/content_flags.h"

namespace lenticule::player {

/// Looks at every file of a source and at its sidecar: of a pattern at the first 256, and at how
/// many there are. Empty for rings and for what is made here. `flags` are those that the source was
/// named with. Costs a stat() for each file.
[[nodiscard]] std::vector<FileMark> marks_of_source(const std::string& text,
                                                    const ContentFlags& flags = {});

}  // namespace lenticule::player
