// SPDX-License-Identifier: Apache-2.0
#include "player/playlist/playlist_reporter.h"

#include <utility>

#include "player/playback/play_statistics.h"

namespace lenticule::player {
namespace {

using EventKind = PlaylistEvent::Kind;

constexpr size_t kRememberedItems = 64;
constexpr size_t kMostDamagedItems = 1000;

}  // namespace

std::string with_remedy(const Error& error) {
  return error.hint().empty() ? error.what() : std::string(error.what()) + "; " + error.hint();
}

PlaylistReporter::PlaylistReporter(const Playlist& list, OnEvent on_event)
    : on_event_(std::move(on_event)) {
  status_.list = list.name;
  status_.items = list.items.size();
}

void PlaylistReporter::report(const PlaylistEvent& event) {
  {
    const std::lock_guard lock(mutex_);
    const bool is_problem = event.kind == EventKind::ItemSkipped || event.kind == EventKind::Kept;
    const bool is_replaced = event.kind == EventKind::Replaced &&
                             problem_.kind == EventKind::Kept && problem_.source == event.source;
    if (is_replaced) status_.last_problem.clear();
    if (is_problem) {
      status_.last_problem = event.detail;
      problem_ = event;
    }
    if (event.kind == EventKind::ItemSkipped) ++status_.skipped;
    if (event.kind == EventKind::LoopPoint) ++status_.loop_points;
  }
  if (on_event_) on_event_(event);
}

void PlaylistReporter::begin(const OpenItem& item) {
  const std::lock_guard lock(mutex_);
  // A problem of another list is over, unless that list continues after an interruption.
  const bool is_other_list = status_.list != item.list->name && !item.interrupts && !item.returns;
  // An item that is opened anew is no longer its copy of before a change of the file.
  const bool is_opened_anew =
      problem_.kind == EventKind::Kept && problem_.source == item.item.source.text && !item.returns;
  if (is_other_list || is_opened_anew) status_.last_problem.clear();
  status_.list = item.list->name;
  status_.items = item.list->items.size();
  status_.source = item.item.source.text;
  const auto index = item.interrupts ? std::nullopt : item.index;
  status_.item = index;
  status_.frames = item.opened.source->frame_count();
  status_.rounds_done = item.rounds_done;
  begun_.push_back({.number = item.number,
                    .source = item.item.source,
                    .index = index,
                    .from_start = item.first_frame == 0 && !item.returns});
  if (begun_.size() > kRememberedItems) begun_.pop_front();
}

void PlaylistReporter::started(const OpenItem& item) {
  {
    const std::lock_guard lock(mutex_);
    ++status_.started;
    if (item.index) status_.waiting_for.clear();
  }
  report({.kind = EventKind::ItemStarted,
          .source = item.item.source.text,
          .woven_elsewhere = item.opened.woven_elsewhere});
}

bool PlaylistReporter::note_waiting(const std::string& why) {
  const std::lock_guard lock(mutex_);
  return std::exchange(status_.waiting_for, why) != why;
}

void PlaylistReporter::loop_done(const OpenItem& item) {
  const std::lock_guard lock(mutex_);
  ++status_.loops;
  locked_played_whole(item);
}

/// Ends the problem of an item that was left out before, and now played without a break.
void PlaylistReporter::locked_played_whole(const OpenItem& item) {
  if (problem_.kind == EventKind::ItemSkipped && problem_.source == item.item.source.text)
    status_.last_problem.clear();
}

void PlaylistReporter::count_damage(OpenItem& item) {
  const frames::FrameDamage now = item.opened.source->damage();
  const frames::FrameDamage before = std::exchange(item.damage, now);
  if (now == before) return;
  const frames::FrameDamage more{.damaged = now.damaged - before.damaged,
                                 .missing = now.missing - before.missing,
                                 .repeated = now.repeated - before.repeated};
  const std::string& source = item.item.source.text;
  const std::lock_guard lock(mutex_);
  status_.damage += more;
  const bool known = status_.damaged_items.contains(source);
  if (known || status_.damaged_items.size() < kMostDamagedItems)
    status_.damaged_items[source] += more;
  if (ItemAccount* const account = locked_account(item.number)) account->damage += more;
}

void PlaylistReporter::end(const OpenItem& item, bool to_end) {
  const std::lock_guard lock(mutex_);
  if (to_end && item.handed_out > 0) locked_played_whole(item);
  ItemAccount* const account = locked_account(item.number);
  if (account == nullptr) return;
  account->to_end = to_end;
  account->handed_out = item.handed_out;
}

void PlaylistReporter::report_damage(const OpenItem& item) {
  if (item.damage.any())
    report({.kind = EventKind::ItemDamaged,
            .source = item.item.source.text,
            .detail = damage_text(item.damage)});
}

void PlaylistReporter::take_list(size_t items, std::optional<size_t> playing) {
  const std::lock_guard lock(mutex_);
  status_.items = items;
  status_.item = playing;
  status_.last_problem.clear();
}

PlaylistStatus PlaylistReporter::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

frames::FrameDamage PlaylistReporter::damage() const {
  const std::lock_guard lock(mutex_);
  return status_.damage;
}

std::optional<ItemAccount> PlaylistReporter::account_of(uint32_t number) const {
  const std::lock_guard lock(mutex_);
  for (const ItemAccount& one : begun_)
    if (one.number == number) return one;
  return std::nullopt;
}

ItemAccount* PlaylistReporter::locked_account(uint32_t number) {
  for (ItemAccount& one : begun_)
    if (one.number == number) return &one;
  return nullptr;
}

}  // namespace lenticule::player
