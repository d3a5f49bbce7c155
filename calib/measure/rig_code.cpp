// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/rig_code.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>

#include "base/error.h"
#include "calib/measure/frame_marks.h"

namespace lenticule::calib {
namespace {

constexpr size_t kFirst = kFindingCodes.size();
constexpr size_t kHexDigits = 16;
constexpr size_t kDigits = (4 * kHexDigits + kCodeBits - 1) / kCodeBits;

}  // namespace

RigCode::RigCode(const std::string& fingerprint) : fingerprint_(fingerprint) {
  LENTICULE_CHECK(fingerprint.size() == kHexDigits);
  uint64_t number = std::stoull(fingerprint, nullptr, 16);
  for (size_t k = 0; k < kDigits; ++k, number >>= kCodeBits)
    digits_.push_back(static_cast<int>(number & ((1U << kCodeBits) - 1U)));
}

int RigCode::of_pattern(size_t n) const {
  return n < kFirst ? kFindingCodes[n] : digits_[(n - kFirst) % kDigits];
}

size_t RigCodeReadings::read() const {
  size_t count = 0;
  for (size_t n = kFirst; n < codes_.size(); ++n) count += codes_[n] != kNoCode ? 1 : 0;
  return count;
}

std::optional<size_t> RigCodeReadings::first_foreign(const RigCode& expected) const {
  for (size_t n = kFirst; n < codes_.size(); ++n)
    if (codes_[n] != kNoCode && codes_[n] != expected.of_pattern(n)) return n;
  return std::nullopt;
}

std::optional<std::string> RigCodeReadings::fingerprint(size_t first) const {
  std::array<int, kDigits> digits{};
  digits.fill(kNoCode);
  for (size_t n = std::max(first, kFirst); n < codes_.size(); ++n) {
    if (codes_[n] == kNoCode) continue;
    int& digit = digits[(n - kFirst) % kDigits];
    if (digit != kNoCode && digit != codes_[n]) return std::nullopt;
    digit = codes_[n];
  }
  uint64_t number = 0;
  for (size_t k = 0; k < kDigits; ++k) {
    if (digits[k] == kNoCode) return std::nullopt;
    number |= static_cast<uint64_t>(digits[k]) << (kCodeBits * k);
  }
  return fmt::format("{:016x}", number);
}

void check_codes(const RigCodeReadings& codes, const RigCode& expected, const std::string& place) {
  const std::optional<size_t> foreign = codes.first_foreign(expected);
  if (!foreign) return;
  const std::string remedy =
      "use the rig that these patterns were written for as --rig, or write patterns for this one "
      "and photograph them";
  if (const std::optional<std::string> other = codes.fingerprint())
    throw Error(ErrorKind::Input,
                fmt::format("{}: the photographs show patterns for the rig with fingerprint {}, "
                            "not for {}",
                            place, *other, expected.fingerprint()),
                remedy);
  throw Error(ErrorKind::Input,
              fmt::format("{}: photograph {} shows a pattern for another rig than the one with "
                          "fingerprint {}",
                          place, *foreign + 1, expected.fingerprint()),
              remedy);
}

}  // namespace lenticule::calib
