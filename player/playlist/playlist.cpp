// SPDX-License-Identifier: Apache-2.0
// Chooses the order and the times of playlist items.
#include "player/playlist/playlist.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <ctime>

namespace lenticule::player {
namespace {

constexpr int kMinutesPerDay = 24 * 60;
constexpr int kMinutesPerWeek = 7 * kMinutesPerDay;

}  // namespace

LocalTime local_time_now() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  return {.weekday = (local.tm_wday + 6) % 7, .minute = local.tm_hour * 60 + local.tm_min};
}

bool Schedule::permits(LocalTime time) const {
  const auto on = [&](int weekday) { return ((days >> ((weekday + 7) % 7)) & 1) != 0; };
  if (from_minute < to_minute)
    return on(time.weekday) && time.minute >= from_minute && time.minute < to_minute;
  const bool evening = on(time.weekday) && time.minute >= from_minute;
  const bool night = on(time.weekday - 1) && time.minute < to_minute;
  return evening || night;
}

int Schedule::minutes_until_begin(LocalTime now) const {
  int least = kMinutesPerWeek;
  for (int day = 0; day < 7; ++day) {
    if (((days >> day) & 1) == 0) continue;
    const int begin = day * kMinutesPerDay + from_minute;
    const int minutes = begin - now.weekday * kMinutesPerDay - now.minute;
    least = std::min(least, (minutes + kMinutesPerWeek) % kMinutesPerWeek);
  }
  return least;
}

size_t Playlist::items_scheduled(LocalTime now) const {
  return static_cast<size_t>(std::ranges::count_if(
      items, [now](const PlaylistItem& item) { return item.permitted(now); }));
}

Playlist playlist_of(const SourceSpec& source, uint64_t rounds) {
  Playlist list{.name = source.text, .items = {}, .standby = {}, .rounds = 1};
  // Loops of the item itself are seamless; rounds of a list are not.
  list.items.push_back({.source = source, .loops = rounds});
  return list;
}

NextItem next_item(const Playlist& list, std::optional<size_t> after, uint64_t rounds_done,
                   LocalTime now) {
  if (list.items.empty()) return {.kind = NextItem::Kind::None, .rounds_done = rounds_done};
  const uint64_t rounds_before = rounds_done;
  size_t index = after ? *after + 1 : 0;
  for (size_t passed = 0; passed <= list.items.size(); ++passed, ++index) {
    if (index >= list.items.size()) {
      ++rounds_done;
      index = 0;
      if (list.rounds != kForever && rounds_done >= list.rounds)
        return {.kind = NextItem::Kind::End, .index = 0, .rounds_done = rounds_done};
    }
    if (list.items[index].permitted(now))
      return {.kind = NextItem::Kind::Item, .index = index, .rounds_done = rounds_done};
  }
  return {.kind = NextItem::Kind::None, .index = index, .rounds_done = rounds_before};
}

std::string reason_to_wait(const Playlist& list, LocalTime now) {
  if (list.items.empty()) return "no file to play yet";
  int wait = kMinutesPerWeek;
  for (const PlaylistItem& item : list.items) {
    if (item.permitted(now)) return {};
    wait = std::min(wait, item.schedule->minutes_until_begin(now));
  }
  const int begin = now.weekday * kMinutesPerDay + now.minute + wait;
  constexpr std::array<const char*, 7> kDays = {"Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun"};
  return fmt::format("no item is scheduled before {} {:02}:{:02}",
                     kDays.at(static_cast<size_t>(begin / kMinutesPerDay % 7)),
                     begin % kMinutesPerDay / 60, begin % 60);
}

}  // namespace lenticule::player
