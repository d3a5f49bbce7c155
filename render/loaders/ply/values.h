// SPDX-License-Identifier: Apache-2.0
// Values reads the numbers after the header of a PLY file, in text or binary.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "render/loaders/ply/header.h"

namespace lenticule::render::ply {

/// Lifetime: must not outlive the data, the source and the element's name.
class Values {
 public:
  Values(std::string_view data, Encoding encoding, const std::string& source)
      : data_(data), encoding_(encoding), source_(source) {}

  /// Throws Error(Input) at the end of the file, and for a word that is no number.
  [[nodiscard]] double next(ValueType type) {
    return encoding_ == Encoding::Text ? next_word() : next_binary(type);
  }

  /// Returns the number of bytes that are left: at least as many as values.
  [[nodiscard]] size_t left() const { return data_.size() - at_; }
  /// Names the element that is read, for messages.
  void set_place(const std::string* element, uint64_t index) {
    element_ = element;
    index_ = index;
  }
  /// Throws Error(Input) "source: element index: reason".
  [[noreturn]] void fail(const std::string& reason) const;

 private:
  [[nodiscard]] double next_word();
  [[nodiscard]] double next_binary(ValueType type);

  std::string_view data_;
  Encoding encoding_;
  const std::string& source_;
  size_t at_ = 0;
  const std::string* element_ = nullptr;
  uint64_t index_ = 0;
};

}  // namespace lenticule::render::ply
