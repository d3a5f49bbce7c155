// SPDX-License-Identifier: Apache-2.0
#include "display/vblank_timeline.h"

#include <fmt/format.h>

#include "base/error.h"

namespace lenticule::display {
namespace {

// n * denominator * 1e9 exceeds 64 bits after minutes at odd refreshes.
__extension__ typedef unsigned __int128 Uint128;

constexpr uint64_t kNanosecondsPerSecond = 1'000'000'000;

Uint128 nanosecond_terms(frames::Rate refresh) {
  return Uint128{static_cast<uint64_t>(refresh.denominator)} * kNanosecondsPerSecond;
}

}  // namespace

VblankTimeline::VblankTimeline(Nanoseconds origin, frames::Rate refresh)
    : origin_(origin), refresh_(refresh) {
  if (refresh.numerator > kMaxTerm || refresh.denominator > kMaxTerm)
    throw Error(ErrorKind::Usage,
                fmt::format("refresh {}: too many digits", frames::to_string(refresh)),
                "write 60, 59.94 or 60000/1001");
}

Nanoseconds VblankTimeline::time_of(uint64_t sequence) const noexcept {
  const Uint128 elapsed =
      Uint128{sequence} * nanosecond_terms(refresh_) / static_cast<uint64_t>(refresh_.numerator);
  return origin_ + Nanoseconds(static_cast<int64_t>(elapsed));
}

// The largest n with floor(n * D / N) <= x is floor(((x + 1) * N - 1) / D).
uint64_t VblankTimeline::sequence_at(Nanoseconds time) const noexcept {
  if (time <= origin_) return 0;
  const auto elapsed = static_cast<uint64_t>((time - origin_).count());
  const Uint128 scaled = (Uint128{elapsed} + 1) * static_cast<uint64_t>(refresh_.numerator) - 1;
  return static_cast<uint64_t>(scaled / nanosecond_terms(refresh_));
}

Nanoseconds VblankTimeline::period() const noexcept {
  return Nanoseconds(
      static_cast<int64_t>(nanosecond_terms(refresh_) / static_cast<uint64_t>(refresh_.numerator)));
}

}  // namespace lenticule::display
