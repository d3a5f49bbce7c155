// SPDX-License-Identifier: Apache-2.0
// RigCode encodes the fingerprint of the patterns' rig as codes beside their marks: each pattern,
// after those that locate the cells, shows one digit of the fingerprint.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace lenticule::calib {

class RigCode {
 public:
  /// Takes the text of optics::fingerprint(rig).
  explicit RigCode(const std::string& fingerprint);

  /// Returns the code of pattern number n.
  [[nodiscard]] int of_pattern(size_t n) const;
  [[nodiscard]] const std::string& fingerprint() const { return fingerprint_; }

 private:
  std::string fingerprint_;
  std::vector<int> digits_;
};

/// RigCodeReadings collects the codes read from pictures of patterns, in their order.
class RigCodeReadings {
 public:
  /// Adds a code; kNoCode if none could be read.
  void add(int code) { codes_.push_back(code); }

  /// Returns the number of pictures with a code, without those that locate the cells.
  [[nodiscard]] size_t read() const;
  /// Returns the number (from 0) of the first picture that shows another rig's code.
  [[nodiscard]] std::optional<size_t> first_foreign(const RigCode& expected) const;
  /// Returns the fingerprint shown by the pictures from number `first` on; empty unless every digit
  /// was read and repeated readings agree.
  [[nodiscard]] std::optional<std::string> fingerprint(size_t first = 0) const;

 private:
  std::vector<int> codes_;
};

/// Throws Error(Input) if the pictures of a place show the code of another rig: patterns of another
/// pitch would give another pitch as the result.
void check_codes(const RigCodeReadings& codes, const RigCode& expected, const std::string& place);

}  // namespace lenticule::calib
