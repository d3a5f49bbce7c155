// SPDX-License-Identifier: Apache-2.0
#include "player/playback/pacing.h"

#include <numeric>

#include "base/error_kinds.h"

namespace lenticule::player {
namespace {

using frames::Rate;

constexpr double kLockTolerance = 0.005;
constexpr int64_t kMaxTerm = 1'000'000'000;  // products of two such terms and 1001 fit 64 bits

bool close(double a, double b) { return std::abs(a / b - 1.0) <= kLockTolerance; }

bool small_terms(Rate rate) { return rate.numerator <= kMaxTerm && rate.denominator <= kMaxTerm; }

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

LatePolicy parse_late_policy(std::string_view text) {
  for (const LatePolicy policy : {LatePolicy::Slip, LatePolicy::Drop, LatePolicy::Hold})
    if (text == late_policy_name(policy)) return policy;
  throw usage_error("late policy '{}': unknown", text).remedy("use slip, drop or hold");
}

const char* late_policy_name(LatePolicy policy) {
  constexpr const char* kNames[] = {"slip", "drop", "hold"};
  return kNames[static_cast<size_t>(policy)];
}

}  // namespace lenticule::player
