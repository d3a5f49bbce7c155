// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as a playlist: the result is an Error with a line, or a valid list.
#include <string>
#include <string_view>

#include "base/error.h"
#include "player/playlist/playlist.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lenticule::player;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const char* const name = text.starts_with("#EXT") ? "fuzz.m3u"
                           : text.starts_with("[{") ? "fuzz.json"
                                                    : "fuzz.toml";
  try {
    const Playlist list = parse_playlist(text, name, "/folder");
    LENTICULE_CHECK(!list.items.empty() && list.items.size() <= kMaxPlaylistItems);
    for (const PlaylistItem& item : list.items) {
      LENTICULE_CHECK(!item.source.text.empty() && item.overlays.size() <= kMaxOverlays);
      LENTICULE_CHECK(item.bed == list.bed && list.bed.volume_db <= kMostVolumeDb);
      for (const OverlaySpec& overlay : item.overlays)
        LENTICULE_CHECK(parse_overlay(overlays_json({&overlay, 1}).front()) == overlay);
    }
    std::optional<size_t> at;
    int64_t rounds = 0;
    for (int step = 0; step < 100; ++step) {
      const NextItem next = next_item(list, at, rounds, {step % 7, step * 14});
      if (next.kind != NextItem::Kind::Item) continue;
      LENTICULE_CHECK(next.index < list.items.size() && next.rounds_done >= rounds);
      at = next.index;
      rounds = next.rounds_done;
    }
  } catch (const lenticule::Error& error) {
    LENTICULE_CHECK(std::string_view(error.what()).starts_with(std::string(name) + ':'));
  }
  return 0;
}
