// SPDX-License-Identifier: Apache-2.0
#include "player/playlist/open_item.h"

#include <algorithm>
#include <cmath>

namespace lenticule::player {

bool OpenItem::waited_too_long() const {
  const std::chrono::duration<double> waited = std::chrono::steady_clock::now() - waiting_since;
  return !is_alone() && waited.count() > item.wait_s;
}

std::optional<uint64_t> OpenItem::frame_limit(frames::Rate rate) const {
  const auto seconds = item.still_s && is_still() ? item.still_s : item.duration_s;
  if (!seconds) return std::nullopt;
  return static_cast<uint64_t>(std::max(1.0, std::round(*seconds * rate.hertz())));
}

}  // namespace lenticule::player
