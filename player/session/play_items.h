// SPDX-License-Identifier: Apache-2.0
// read_playlist and item_opener read the lists and open the items of a run of `lenticule play`.
#pragma once

#include "player/playlist/open_item.h"
#include "player/session/play_plan.h"

namespace lenticule::player {

/// Returns the list to play: that of a file, or a list of one source. Throws Error.
[[nodiscard]] Playlist read_playlist(const SourceSpec& source, const PlayFlags& flags,
                                     const PlayPlan& plan);
/// Returns a function that opens items as the plan's source would be opened.
[[nodiscard]] ItemOpener item_opener(const SourceRequest& like);

}  // namespace lenticule::player
