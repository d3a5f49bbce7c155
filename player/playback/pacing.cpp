// SPDX-License-Identifier: Apache-2.0
#include "player/playback/pacing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"

namespace lenticule::player {
namespace {

using frames::Rate;

constexpr double kLockTolerance = 0.005;
constexpr uint64_t kFinePlaces = uint64_t{1} << 20;
constexpr int64_t kMaxTerm = 1'000'000'000;  // products of two such terms and 1001 fit 64 bits

bool close(double a, double b) {
  return std::abs(a / b - 1.0) <= kLockTolerance;
}

bool small_terms(Rate rate) {
  return rate.numerator <= kMaxTerm && rate.denominator <= kMaxTerm;
}

Rate reduced(int64_t numerator, int64_t denominator) {
  const int64_t divisor = std::gcd(numerator, denominator);
  return {numerator / divisor, denominator / divisor};
}

/// Returns true if the frames repeat in a pattern shorter than that of a broadcast rate on a plain
/// refresh (24 on 59.94).
bool short_cadence(Rate content, Rate refresh) {
  constexpr int64_t kLongestPattern = 240;
  const int64_t content_terms = content.numerator * refresh.denominator;
  const int64_t refresh_terms = refresh.numerator * content.denominator;
  return content_terms / std::gcd(content_terms, refresh_terms) <= kLongestPattern;
}

}  // namespace

Rate locked_rate(Rate content, Rate refresh) {
  if (!small_terms(content) || !small_terms(refresh)) return content;
  const double ratio = refresh.hertz() / content.hertz();
  const double vblanks = std::round(ratio);
  if (vblanks >= 1.0 && close(ratio, vblanks))
    return reduced(refresh.numerator, refresh.denominator * static_cast<int64_t>(vblanks));
  const double frames = std::round(1.0 / ratio);
  if (frames >= 1.0 && close(1.0 / ratio, frames))
    return reduced(refresh.numerator * static_cast<int64_t>(frames), refresh.denominator);

  if (short_cadence(content, refresh)) return content;
  const Rate slower = reduced(content.numerator * 1000, content.denominator * 1001);
  const Rate faster = reduced(content.numerator * 1001, content.denominator * 1000);
  for (const Rate sibling : {slower, faster})
    if (small_terms(sibling) && short_cadence(sibling, refresh)) return sibling;
  return content;
}

Rate scaled_rate(Rate rate, uint32_t permille) noexcept {
  if (permille == 1000) return rate;
  // Terms above this size are those of no real rate; a millionth of a frame per second is exact
  // enough for them.
  if (!small_terms(rate)) rate = {static_cast<int64_t>(rate.hertz() * 1e6), 1'000'000};
  return reduced(rate.numerator * int64_t{permille}, rate.denominator * 1000);
}

Cadence::Cadence(Rate content, Rate refresh) {
  const Uint128 vblanks = Uint128{static_cast<uint64_t>(refresh.numerator)} *
                          static_cast<uint64_t>(content.denominator);
  divisor_ = Uint128{static_cast<uint64_t>(refresh.denominator)} *
             static_cast<uint64_t>(content.numerator);
  whole_ = vblanks / divisor_;
  remainder_ = vblanks % divisor_;
  // set_fraction() needs more than the few places that 60 on 60 Hz has.
  if (divisor_ >= kFinePlaces) return;
  remainder_ *= kFinePlaces;
  divisor_ *= kFinePlaces;
}

uint64_t Cadence::next_due() const noexcept {
  const bool carry = fraction_ + remainder_ >= divisor_;
  return due_ + static_cast<uint64_t>(whole_) + (carry ? 1 : 0);
}

void Cadence::advance() noexcept {
  due_ = next_due();
  fraction_ += remainder_;
  if (fraction_ >= divisor_) fraction_ -= divisor_;
  ++frame_;
}

void Cadence::set_fraction(double fraction) noexcept {
  fraction_ =
      std::min(static_cast<Uint128>(fraction * static_cast<double>(divisor_)), divisor_ - 1);
}

LatePolicy parse_late_policy(std::string_view text) {
  for (const LatePolicy policy : {LatePolicy::Slip, LatePolicy::Drop, LatePolicy::Hold})
    if (text == late_policy_name(policy)) return policy;
  throw Error(ErrorKind::Usage, fmt::format("late policy '{}': unknown", text),
              "use slip, drop or hold");
}

const char* late_policy_name(LatePolicy policy) {
  switch (policy) {
    case LatePolicy::Slip:
      return "slip";
    case LatePolicy::Drop:
      return "drop";
    case LatePolicy::Hold:
      return "hold";
  }
  return "unknown";
}

Pacer::Pacer(frames::Rate content, frames::Rate refresh, LatePolicy policy)
    : content_(locked_rate(content, refresh)),
      refresh_(refresh),
      policy_(policy),
      start_up_vblanks_(static_cast<uint64_t>(refresh.hertz()) + 1),
      cadence_(content_, refresh_) {}

PaceDecision Pacer::decide(uint64_t target, bool ready) noexcept {
  if (epoch_pending_) return ready ? PaceDecision::Submit : PaceDecision::Starved;
  if (target < due()) return PaceDecision::Later;
  if (!owed_since_) owed_since_ = expected_vblank();
  if (!ready) {
    if (!starved_since_) starved_since_ = target;
    return PaceDecision::Starved;
  }
  // Dropping a late frame helps only if the frame after it is due as well.
  const bool replaceable = due() < target && origin_ + cadence_.next_due() <= target;
  if (policy_ == LatePolicy::Drop && replaceable && consecutive_drops_ < kMaxConsecutiveDrops) {
    ++consecutive_drops_;
    ++counts_.dropped;
    cadence_.advance();
    return PaceDecision::Skip;
  }
  return PaceDecision::Submit;
}

void Pacer::submitted(uint64_t target, bool in_time) noexcept {
  available_at_ = in_time ? target : target + 1;
}

uint64_t Pacer::expected_vblank() const noexcept {
  return shown_at_ ? std::max(due(), *shown_at_ + 1) : due();
}

void Pacer::flipped(uint64_t sequence) noexcept {
  if (epoch_pending_) {
    begin_schedule(sequence);
  } else {
    // The counter of a working display never goes back; clamp the value of one that does.
    sequence = std::max(sequence, *shown_at_ + 1);
    const uint64_t expected = std::min(owed_since_.value_or(expected_vblank()), sequence);
    const uint64_t starved_from = std::max(starved_since_.value_or(sequence), expected);
    const uint64_t starved_to = std::max(std::min(available_at_, sequence), starved_from);
    account(expected, sequence, starved_to - starved_from);

    const bool gave_up_catching_up = consecutive_drops_ >= kMaxConsecutiveDrops;
    if (sequence > due() && (policy_ != LatePolicy::Drop || gave_up_catching_up)) {
      counts_.slipped += sequence - due();
      origin_ += sequence - due();
    }
  }
  owed_since_.reset();
  starved_since_.reset();
  consecutive_drops_ = 0;
  shown_at_ = sequence;
  ++counts_.shown;
  ++counts_.vblanks;
  advance_past_same_vblank();
}

void Pacer::resume(frames::Rate content, frames::Rate refresh, uint64_t frame) noexcept {
  content_ = locked_rate(content, refresh);
  refresh_ = refresh;
  cadence_ = Cadence(content_, refresh_);
  base_frame_ = frame;
  owed_since_.reset();
  consecutive_drops_ = 0;
  begin_epoch();
}

void Pacer::change_rate(frames::Rate content) noexcept {
  base_frame_ = frame();
  origin_ = due();
  content_ = locked_rate(content, refresh_);
  cadence_ = Cadence(content_, refresh_);
}

int Pacer::shift(double vblanks) noexcept {
  const double moved = cadence_.fraction() + vblanks;
  const double whole = std::floor(moved);
  origin_ += static_cast<uint64_t>(static_cast<int64_t>(whole));
  cadence_.set_fraction(moved - whole);
  return static_cast<int>(whole);
}

/// Classifies the vblanks after the last flip, up to `end`: planned until `expected`, then starved,
/// then missed.
void Pacer::account(uint64_t expected, uint64_t end, uint64_t starved) noexcept {
  const uint64_t planned = expected - *shown_at_ - 1;
  counts_.repeated_planned += planned;
  counts_.missed += end - expected - starved;
  counts_.vblanks += end - *shown_at_ - 1;
  count_underrun(starved);
}

void Pacer::count_underrun(uint64_t starved) noexcept {
  if (starved == 0) return;
  counts_.repeated_underrun += starved;
  ++counts_.underruns;
  if (*starved_since_ > first_vblank_ + start_up_vblanks_) ++counts_.underruns_after_start;
}

void Pacer::begin_schedule(uint64_t sequence) noexcept {
  if (shown_at_) {
    sequence = std::max(sequence, *shown_at_ + 1);
    counts_.held += sequence - *shown_at_ - 1;
    counts_.vblanks += sequence - *shown_at_ - 1;
  } else {
    first_vblank_ = sequence;
  }
  base_frame_ = frame();
  cadence_ = Cadence(content_, refresh_);
  origin_ = sequence;
  epoch_pending_ = false;
}

/// Advances to the next frame; of several frames due at one vblank only the first is shown.
void Pacer::advance_past_same_vblank() noexcept {
  const uint64_t shown_due = cadence_.due();
  cadence_.advance();
  while (cadence_.due() == shown_due) {
    cadence_.advance();
    ++counts_.skipped_planned;
  }
}

void Pacer::finish(uint64_t end) noexcept {
  if (!shown_at_ || end <= *shown_at_ + 1) return;
  const uint64_t tail = end - *shown_at_ - 1;
  const uint64_t expected = owed_since_.value_or(expected_vblank());
  const uint64_t planned = std::min(tail, expected - *shown_at_ - 1);
  const uint64_t starved =
      starved_since_ && *starved_since_ < end ? std::min(end - *starved_since_, tail - planned) : 0;
  counts_.repeated_planned += planned;
  counts_.held += tail - planned - starved;
  counts_.vblanks += tail;
  count_underrun(starved);
}

}  // namespace lenticule::player
