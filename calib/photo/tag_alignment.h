// SPDX-License-Identifier: Apache-2.0
// Locates a tag that was found by all of its edges: the lenses make every edge coarse, so that the
// outline alone leaves its corners uncertain.
#pragma once

#include <vector>

#include "calib/photo/tag_finder.h"

namespace lenticule::calib {

/// Moves the corners of a tag so that its cells, blurred, fit the picture best. `white` is
/// TagFamily::cells() of its id. Returns the tag unchanged if no fit is found near it, as for a tag
/// that is partly hidden.
///
/// Thread safety: any thread.
[[nodiscard]] TagSighting aligned(const PhotoLight& picture, const TagSighting& tag,
                                  const std::vector<bool>& white);

}  // namespace lenticule::calib
