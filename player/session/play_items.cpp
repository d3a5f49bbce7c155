// SPDX-License-Identifier: Apache-2.0
#include "player/session/play_items.h"

#include "player/session/card_texts.h"

namespace lenticule::player {

Playlist read_playlist(const SourceSpec& source, const PlayFlags& flags, const PlayPlan& plan) {
  if (source.kind != SourceKind::List) {
    Playlist list = playlist_of(source, plan.playback.loops);
    PlaylistItem& item = list.items.front();
    if (source == plan.source.spec) item.frames = plan.source.frames;
    // In simulated time a picture that stays would never end: there is no moment for Ctrl-C.
    const bool stays = flags.loop.empty() && flags.clock != "simulated";
    if (item.loops != kForever && source.has_pictures())
      item.still_s = stays ? kUntilEnded : kStillSeconds * static_cast<double>(item.loops);
    return list;
  }
  Playlist list = names_folder(source.text) ? plan.folders->read(source)
                                            : plan.folders->with_files(load_playlist(source.text));
  const bool says_how_often = !flags.loop.empty() || flags.duration_s;
  if (says_how_often) list.rounds = plan.playback.loops;
  return list;
}

ItemOpener item_opener(const SourceRequest& like) {
  return [like](const PlaylistItem& item, uint64_t first_frame) {
    SourceRequest request = like;
    request.spec = item.source;
    request.frames = item.frames;
    if (!item.reason.empty()) {
      request.card = error_card(like.spec.text, Error(ErrorKind::Input, item.reason));
      for (WallPart& part : request.wall) part.card = request.card;
    }
    request.first_frame = first_frame;
    request.plays_again = item.loops != 1 || item.duration_s.has_value();
    return open_source(request);
  };
}

}  // namespace lenticule::player
