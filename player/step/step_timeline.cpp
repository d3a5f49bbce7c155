// SPDX-License-Identifier: Apache-2.0
#include "player/step/step_timeline.h"

#include <algorithm>

namespace lenticule::player {
namespace {

using std::chrono::nanoseconds;
__extension__ typedef __int128 Int128;

constexpr Int128 kSecond = 1'000'000'000;
constexpr int64_t kMaxTerm = 1'000'000'000;
constexpr uint64_t kMaxFrames = 1'000'000'000'000;
constexpr int64_t kMaxTime = int64_t{1} << 62;  // the year 2116

Int128 floor_divided(Int128 value, Int128 divisor) noexcept {
  const Int128 quotient = value / divisor;
  return value % divisor < 0 ? quotient - 1 : quotient;
}

}  // namespace

nanoseconds StepTimeline::lateness(uint64_t number, nanoseconds time) const noexcept {
  // In units of 1 / numerator nanoseconds, so that a loop is a whole number of units.
  const Int128 frame_units = kSecond * rate.denominator;
  const Int128 ahead = static_cast<Int128>(number) - static_cast<Int128>(frame);
  Int128 late =
      (static_cast<Int128>(time.count()) - due.count()) * rate.numerator - ahead * frame_units;
  if (loop_frames > 0) {
    const Int128 loop = static_cast<Int128>(loop_frames) * frame_units;
    late -= floor_divided(late + loop / 2, loop) * loop;
  }
  late = floor_divided(late, rate.numerator);
  return nanoseconds(static_cast<int64_t>(std::clamp<Int128>(late, -kMaxTime, kMaxTime)));
}

StepTimeline StepTimeline::stated_after(nanoseconds time) const noexcept {
  const Int128 frame_units = kSecond * rate.denominator;
  const Int128 elapsed = (static_cast<Int128>(time.count()) - due.count()) * rate.numerator;
  Int128 ahead = floor_divided(elapsed, frame_units) + 1;
  Int128 number = static_cast<Int128>(frame) + ahead;
  if (loop_frames > 0) {
    const auto loop = static_cast<Int128>(loop_frames);
    number -= floor_divided(number, loop) * loop;
  } else if (number < 0) {  // before the first frame
    ahead -= number;
    number = 0;
  }
  StepTimeline stated = *this;
  stated.frame = static_cast<uint64_t>(number);
  stated.due +=
      nanoseconds(static_cast<int64_t>(floor_divided(ahead * frame_units, rate.numerator)));
  return stated;
}

StepTimeline StepTimeline::on_clock_ahead_by(nanoseconds ahead) const noexcept {
  StepTimeline moved = *this;
  moved.due += ahead;
  return moved;
}

bool StepTimeline::valid() const noexcept {
  const auto term = [](int64_t value) { return value >= 1 && value <= kMaxTerm; };
  return term(rate.numerator) && term(rate.denominator) && frame <= kMaxFrames &&
         loop_frames <= kMaxFrames && due.count() > -kMaxTime && due.count() < kMaxTime;
}

}  // namespace lenticule::player
