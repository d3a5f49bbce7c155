// SPDX-License-Identifier: Apache-2.0
// Describes a playlist to clients of the control socket, with the keys of its file.
#pragma once

#include <nlohmann/json.hpp>

#include "player/playlist/playlist.h"

namespace lenticule::player {

/// Returns {"file", "loop", "default", "count", "first", "items"}: the items from `first` on, at
/// least one if there is one, and more as long as their text is shorter than `most_bytes`.
[[nodiscard]] nlohmann::ordered_json list_json(const Playlist& list, size_t first,
                                               size_t most_bytes = size_t{32} << 10);

}  // namespace lenticule::player
