// SPDX-License-Identifier: Apache-2.0
#include "player/playlist/open_item.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace lenticule::player {

bool OpenItem::waited_too_long() const {
  const std::chrono::duration<double> waited = std::chrono::steady_clock::now() - waiting_since;
  return !is_alone() && waited.count() > item.wait_s;
}

bool OpenItem::live_is_over() const {
  const std::chrono::duration<double> shown = std::chrono::steady_clock::now() - begun;
  return opened.live && item.duration_s && shown.count() >= *item.duration_s;
}

std::optional<uint64_t> OpenItem::frame_limit(frames::Rate rate) const {
  if (!seconds()) return std::nullopt;
  const double frames = std::round((*seconds() - blended_s) * rate.hertz());
  return static_cast<uint64_t>(std::max(blended_s > 0.0 ? 0.0 : 1.0, frames));
}

Error no_such_frame(const PlaylistItem& item, uint64_t frame, uint64_t count) {
  const std::string& name = item.source.text;
  if (count == 0) return {ErrorKind::Input, name + ": it contains no frame"};
  return {ErrorKind::Usage,
          fmt::format("frame {}: {} has the frames 0 to {}", frame, name, count - 1)};
}

ItemProgress progress_of(const OpenItem& item, uint64_t given) {
  return {.number = item.number,
          .first_frame = item.first_frame,
          .began_at = item.began_at,
          .frame = item.last_number,
          .frames_pulled = item.frames_pulled,
          .pulled_this_round = item.pulled_this_round,
          .loops_done = item.loops_done,
          .blended_s = item.blended_s,
          .frame_count = item.opened.source->frame_count(),
          .given = given};
}

ItemProgress progress_at(ItemProgress progress, const LeftItem& left) {
  progress.final = true;
  if (!left.last) {  // it begins again
    progress.frame = progress.first_frame;
    progress.frames_pulled = progress.pulled_this_round = progress.loops_done = 0;
    progress.blended_s = 0.0;
    return progress;
  }
  const uint64_t again = progress.given - std::min(progress.given, left.last->index);
  progress.frame = left.last->number;
  progress.frames_pulled -= std::min(progress.frames_pulled, again);
  if (again > progress.pulled_this_round) {
    const uint64_t before = again - progress.pulled_this_round - 1;
    const uint64_t rounds =
        1 + before / std::max<uint64_t>(1, progress.frame_count.value_or(before + 1));
    progress.loops_done -= std::min(progress.loops_done, rounds);
    progress.pulled_this_round = progress.frame;
  } else {
    progress.pulled_this_round -= again;
  }
  return progress;
}

void continue_item(OpenItem& item, const ItemProgress& progress) {
  item.began_at = progress.began_at;
  item.frames_pulled = progress.frames_pulled;
  item.pulled_this_round = progress.pulled_this_round;
  item.loops_done = progress.loops_done;
  item.blended_s = progress.blended_s;
  item.returns = true;
}

}  // namespace lenticule::player
