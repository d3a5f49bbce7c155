// SPDX-License-Identifier: Apache-2.0
#include "frames/rational.h"

#include <fmt/format.h>

#include <numeric>
#include <optional>

#include "base/error_kinds.h"
#include "base/numbers.h"

namespace lenticule::frames {
namespace {

constexpr int64_t kMaxRate = 10000;
constexpr int64_t kMaxSecondsPerFrame = 3600;
constexpr int kMaxDecimals = 6;

[[noreturn]] void reject(std::string_view text) {
  throw usage_error("rate '{}': not a rate", text)
      .remedy("write frames per second: 60, 59.94, 12.5 or 24000/1001");
}

/// Returns a > factor * b for positive numbers, without the product, which may overflow.
bool exceeds(int64_t a, int64_t factor, int64_t b) {
  return a / factor > b || (a / factor == b && a % factor != 0);
}

/// Returns the integer rate n for a text of two or three decimals that means the broadcast rate
/// n*1000/1001.
std::optional<int64_t> broadcast_rate(std::string_view text) {
  struct Name {
    std::string_view text;
    int64_t nominal;
  };
  static constexpr Name kNames[] = {{"23.976", 24}, {"23.98", 24}, {"29.97", 30},  {"47.952", 48},
                                    {"47.95", 48},  {"59.94", 60}, {"119.88", 120}};
  for (const Name& name : kNames)
    if (text == name.text) return name.nominal;
  return std::nullopt;
}

}  // namespace

Rate make_rate(int64_t numerator, int64_t denominator) {
  const bool positive = numerator > 0 && denominator > 0;
  if (!positive || exceeds(numerator, kMaxRate, denominator) ||
      exceeds(denominator, kMaxSecondsPerFrame, numerator))
    throw usage_error("rate {}/{}: out of range", numerator, denominator)
        .remedy("write 1/3600 to 10000 frames per second, for example 24");
  const int64_t divisor = std::gcd(numerator, denominator);
  return {numerator / divisor, denominator / divisor};
}

Rate parse_rate(std::string_view text) {
  if (const auto nominal = broadcast_rate(text)) return make_rate(*nominal * 1000, 1001);

  if (text.find('/') != std::string_view::npos) {
    const auto ratio = numbers_from<int64_t, 2>(text, '/');
    if (!ratio) reject(text);
    return make_rate((*ratio)[0], (*ratio)[1]);
  }

  const size_t point = text.find('.');
  const std::string_view decimals =
      point == std::string_view::npos ? std::string_view() : text.substr(point + 1);
  std::string digits(text.substr(0, point));
  digits += decimals;
  const bool plain = !digits.empty() && digits.size() <= 12 &&
                     digits.find_first_not_of("0123456789") == std::string::npos;
  if (!plain || decimals.size() > kMaxDecimals) reject(text);
  int64_t denominator = 1;
  for (size_t i = 0; i < decimals.size(); ++i) denominator *= 10;
  return make_rate(*number_from<int64_t>(digits), denominator);
}

std::string to_string(Rate rate) {
  return rate.denominator == 1 ? fmt::format("{}", rate.numerator)
                               : fmt::format("{}/{}", rate.numerator, rate.denominator);
}

}  // namespace lenticule::frames
