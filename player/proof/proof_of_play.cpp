// SPDX-License-Identifier: Apache-2.0
#include "player/proof/proof_of_play.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "player/proof/proof_report.h"

namespace lenticule::player {
namespace {

using Event = ProofEntry::Event;

/// Time after which a turn gets a further entry, which limits what a power failure can lose.
constexpr uint64_t kLongestSpanNs = 600'000'000'000;

}  // namespace

ProofOfPlay::ProofOfPlay(ProofOptions options) : options_(std::move(options)) {}

void ProofOfPlay::update(TurnLog& turns, const ProofPanel& panel) {
  while (const auto ended = turns.take()) {
    count(*ended, panel);
    count_last_play(*ended);
    write(Event::Ended, ended->ended_ns);
    open_.reset();
  }
  const ItemTurn running = turns.running();
  if (running.turn == 0) return;
  count(running, panel);
  if (running.ended_ns - open_->span_from_ns >= kLongestSpanNs)
    write(Event::Continues, running.ended_ns);
}

void ProofOfPlay::begin(const ItemTurn& turn, const ProofPanel& panel) {
  OpenTurn& open = open_.emplace();
  open.counted = {.turn = turn.turn, .item = turn.item, .begun_ns = turn.begun_ns};
  open.account.source.text = "unknown";
  if (const auto account = options_.account(turn.item)) open.account = *account;
  open.spoiled = !open.account.from_start;
  open.span_from_ns = turn.begun_ns;
  open.span = {.session = options_.session,
               .turn = ++turns_,
               .item = open.account.source.text,
               .panel = panel.name,
               .exactness = panel.exactness,
               .process_start = options_.process_start};
  options_.begin_hash(open.account.source);
  write(Event::Started, turn.begun_ns);
}

/// Adds what was displayed since the last call to the span, and begins the turn first if it is new.
void ProofOfPlay::count(const ItemTurn& turn, const ProofPanel& panel) {
  if (!open_ || open_->counted.turn != turn.turn) begin(turn, panel);
  OpenTurn& open = *open_;
  if (const auto account = options_.account(turn.item)) open.account = *account;
  ProofEntry& span = open.span;
  const uint64_t frames = turn.frames - open.counted.frames;
  (panel.away ? span.unseen : span.frames) += frames;
  open.spoiled |= panel.away;
  const uint64_t rounds = turn.rounds - open.counted.rounds;
  if (rounds > 0) {
    const uint64_t spoiled = panel.away ? rounds : open.spoiled ? 1 : 0;
    span.interrupted += spoiled;
    span.whole += rounds - spoiled;
    open.spoiled = panel.away;
  }
  span.missed += turn.missed - open.counted.missed;
  const uint64_t damage = open.account.damage.damaged + open.account.damage.missing;
  span.damaged += damage - std::min(damage, open.written_damage);
  open.written_damage = damage;
  span.exactness = worse_exactness(span.exactness, panel.exactness);
  open.counted = turn;
}

void ProofOfPlay::count_last_play(const ItemTurn& turn) {
  const ItemAccount& account = open_->account;
  // A jump may come when the last frame is already displayed.
  const bool all_shown = turn.cut == 0 || turn.frames + turn.left_out >= account.handed_out;
  const bool whole = account.to_end && all_shown && !open_->spoiled;
  ++(whole ? open_->span.whole : open_->span.interrupted);
}

void ProofOfPlay::write(Event event, uint64_t until_ns) {
  ProofEntry& span = open_->span;
  span.event = event;
  span.hash = options_.hash(open_->account.source);
  span.from_us = options_.real_time(open_->span_from_ns);
  span.until_us = std::max(span.from_us, options_.real_time(until_ns));
  options_.write(span);
  span.frames = span.unseen = span.missed = span.damaged = span.whole = span.interrupted = 0;
  span.exactness = kNoExactness;
  open_->span_from_ns = until_ns;
}

std::function<int64_t(uint64_t)> monotonic_to_real_time() {
  return [](uint64_t display_ns) {
    using std::chrono::duration_cast;
    using std::chrono::microseconds;
    const auto real = std::chrono::system_clock::now().time_since_epoch();
    const auto since =
        std::chrono::steady_clock::now().time_since_epoch() - std::chrono::nanoseconds(display_ns);
    return duration_cast<microseconds>(real).count() - duration_cast<microseconds>(since).count();
  };
}

}  // namespace lenticule::player
