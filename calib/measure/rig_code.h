// SPDX-License-Identifier: Apache-2.0
// The fingerprint of the rig that patterns were drawn for, as codes beside their marks: each
// pattern after those that the cells are found with shows one digit of it.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace lenticule::calib {

class RigCode {
 public:
  /// Of optics::fingerprint(rig).
  explicit RigCode(const std::string& fingerprint);

  /// The code that pattern number n shows.
  [[nodiscard]] int of_pattern(size_t n) const;
  [[nodiscard]] const std::string& fingerprint() const { return fingerprint_; }

 private:
  std::string fingerprint_;
  std::vector<int> digits_;
};

/// The codes that pictures of patterns showed, in their order.
class RigCodeReadings {
 public:
  /// kNoCode where none could be read.
  void add(int code) { codes_.push_back(code); }

  /// Pictures with a code, those that the cells were found with left out.
  [[nodiscard]] size_t read() const;
  /// Number of the first picture that shows another rig's code, from 0.
  [[nodiscard]] std::optional<size_t> first_foreign(const RigCode& expected) const;
  /// The fingerprint that the pictures from number `first` on show; empty unless every digit was
  /// read and those that were read several times agree.
  [[nodiscard]] std::optional<std::string> fingerprint(size_t first = 0) const;

 private:
  std::vector<int> codes_;
};

}  // namespace lenticule::calib
