// SPDX-License-Identifier: Apache-2.0
#include "player/step/step_pacing.h"

#include <algorithm>
#include <cmath>
#include <utility>

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

namespace {

using std::chrono::nanoseconds;

/// A player is in step when its schedule is within the tolerance, and remains so until it is this
/// many vblanks away.
constexpr double kLost = 1.0;
constexpr double kMillion = 1e6;
/// Vblanks after which the drift is measured well enough.
constexpr uint64_t kDriftVblanks = 600;

}  // namespace

/// Returns the timeline of the group; its rate is 0 if it is not known.
StepTimeline StepPacing::timeline() const noexcept {
  StepTimeline timeline = target_.read();
  if (timeline.loop_frames == 0) timeline.loop_frames = place_.loop_frames;
  return timeline;
}

double StepPacing::correction(const StepSample& sample) noexcept {
  // A frame is moved once, before its time: later it could only be late.
  if (place_.started != 0 && sample.index == last_index_) return 0.0;
  learn_loop(sample);
  place_.started = 1;
  place_.next_frame = sample.frame;
  place_.next_due_ns = sample.due.count();
  place_.rate = sample.rate;
  place_.period_ns = sample.period.count();
  const StepTimeline group = timeline();
  const double shift = group.rate.numerator > 0 ? correction_to(group, sample) : 0.0;
  published_.publish(place_);
  return shift;
}

double StepPacing::correction_to(const StepTimeline& group, const StepSample& sample) noexcept {
  const nanoseconds late_by = group.lateness(sample.frame, sample.due);
  const double late =
      static_cast<double>(late_by.count()) / static_cast<double>(sample.period.count());
  update_state(late, sample.vblank);
  measure_drift(late, sample.vblank);
  const uint64_t pause = place_.in_step != 0 ? kStepTrackingVblanks : kStepJoiningVblanks;
  if (std::abs(late) <= kStepTolerance || sample.vblank < last_correction_ + pause) return 0.0;
  const double shift = -std::clamp(late, -1.0, 1.0);
  last_correction_ = sample.vblank;
  corrected_ += shift;
  return shift;
}

void StepPacing::moved(int vblanks) noexcept {
  if (vblanks > 0) place_.repeated += static_cast<uint64_t>(vblanks);
  if (vblanks < 0) place_.dropped += static_cast<uint64_t>(-vblanks);
}

void StepPacing::shown(uint64_t frame, nanoseconds vblank) noexcept {
  place_.shown_frame = frame;
  place_.shown_ns = vblank.count();
  const StepTimeline group = timeline();
  if (group.rate.numerator > 0 && place_.period_ns > 0) {
    const nanoseconds late = group.lateness(frame, vblank);
    const double vblanks =
        static_cast<double>(late.count()) / static_cast<double>(place_.period_ns);
    // A frame belongs to the vblank period that contains its due time: it appears half a vblank
    // before that time on average.
    place_.difference = static_cast<int64_t>((vblanks + 0.5) * kMillion);
    if (place_.in_step != 0)
      place_.largest_difference = std::max(place_.largest_difference, std::abs(place_.difference));
  }
  published_.publish(place_);
}

/// Learns the length of the loop when the numbers of the frames begin again.
void StepPacing::learn_loop(const StepSample& sample) noexcept {
  const uint64_t before = std::exchange(last_index_, sample.index);
  if (place_.started == 0 || sample.index < before || sample.frame > place_.next_frame) return;
  const uint64_t length = place_.next_frame + (sample.index - before) - sample.frame;
  if (length > 0) place_.loop_frames = length;
}

void StepPacing::update_state(double late, uint64_t vblank) noexcept {
  const double away = std::abs(late);
  if (place_.in_step == 0 && away <= kStepTolerance) {
    place_.in_step = 1;
    ++place_.joined;
    in_step_since_ = vblank;
    late_at_start_ = late;
    corrected_ = 0.0;
  } else if (away > kLost) {
    place_.in_step = 0;
  }
}

void StepPacing::measure_drift(double late, uint64_t vblank) noexcept {
  if (place_.in_step == 0 || vblank < in_step_since_ + kDriftVblanks) return;
  const double drifted = late - late_at_start_ - corrected_;
  place_.drift_ppb =
      static_cast<int64_t>(drifted * 1e9 / static_cast<double>(vblank - in_step_since_));
}

}  // namespace lenticule::player
