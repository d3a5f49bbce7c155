// SPDX-License-Identifier: Apache-2.0
// Functions that make errors of each kind with a formatted text:
//   throw input_error("{}: has no frames", file).remedy("render it again");
#pragma once

#include <fmt/format.h>

#include <string>
#include <utility>

#include "base/error.h"

namespace lenticule {

/// FormattedError is an Error that can get a remedy where it is made.
class FormattedError : public Error {
 public:
  using Error::Error;
  [[nodiscard]] Error remedy(std::string hint) const { return {kind(), what(), std::move(hint)}; }
};

/// ErrorMaker makes errors of one kind.
template <ErrorKind kind>
struct ErrorMaker {
  template <class... Args>
  [[nodiscard]] FormattedError operator()(fmt::format_string<Args...> text, Args&&... args) const {
    return {kind, fmt::format(text, std::forward<Args>(args)...)};
  }
};
inline constexpr ErrorMaker<ErrorKind::Failed> failed_error;
inline constexpr ErrorMaker<ErrorKind::Usage> usage_error;
inline constexpr ErrorMaker<ErrorKind::Device> device_error;
inline constexpr ErrorMaker<ErrorKind::Input> input_error;
inline constexpr ErrorMaker<ErrorKind::Quality> quality_error;

}  // namespace lenticule
