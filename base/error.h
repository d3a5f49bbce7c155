// SPDX-License-Identifier: Apache-2.0
// Failures that the world causes (a file, a device, an argument), and the check for our own bugs.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

namespace lenticule {

/// What kind of failure an Error is. The values are the exit codes of the command line.
enum class ErrorKind {
  Failed = 1,   ///< it could not be done (a full disk, a lost peer)
  Usage = 2,    ///< the request itself makes no sense (flags, ranges)
  Device = 3,   ///< a device is missing, busy or forbidden
  Input = 4,    ///< the input is invalid, or was made for another rig
  Quality = 5,  ///< it was done, but a quality limit was missed
};

/// Thrown while setting something up; running loops return values instead.
///
/// `what()` is one line: object first, then cause, lower case, no full stop:
/// "rig.toml:12: unknown key 'pich_subpx'". `hint()` is the remedy, or empty.
class Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, const std::string& what, std::string hint = {})
      : std::runtime_error(what), kind_(kind), hint_(std::move(hint)) {}

  [[nodiscard]] ErrorKind kind() const noexcept { return kind_; }
  [[nodiscard]] const std::string& hint() const noexcept { return hint_; }

 private:
  ErrorKind kind_;
  std::string hint_;
};

/// Prints the broken promise and aborts. Use LENTICULE_CHECK.
[[noreturn]] void check_failed(const char* file, int line, const char* condition) noexcept;

}  // namespace lenticule

/// States an invariant of our own code; on in release builds. Never for input.
#define LENTICULE_CHECK(condition)                               \
  do {                                                           \
    if (!(condition)) [[unlikely]]                               \
      ::lenticule::check_failed(__FILE__, __LINE__, #condition); \
  } while (false)
