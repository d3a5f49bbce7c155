// SPDX-License-Identifier: Apache-2.0
// Error reports failures with an external cause (a file, a device, an argument); LENTICULE_CHECK
// finds our own bugs.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

namespace lenticule {

/// ErrorKind classifies errors. The values are the exit codes of the command line.
enum class ErrorKind {
  Failed = 1,   ///< the operation failed (a full disk, a lost peer)
  Usage = 2,    ///< the request is invalid (flags, ranges)
  Device = 3,   ///< a device is missing, busy or forbidden
  Input = 4,    ///< the input is invalid, or was made for another rig
  Quality = 5,  ///< the operation finished, but missed a quality limit
};

/// Error is thrown during setup; running loops return values instead.
///
/// `what()` is one line: first the object, then the cause, in lower case and without a full stop:
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

/// Prints the violated invariant and aborts. Use LENTICULE_CHECK.
[[noreturn]] void check_failed(const char* file, int line, const char* condition) noexcept;

}  // namespace lenticule

/// Checks an invariant of our own code, in release builds too. Not for input.
#define LENTICULE_CHECK(condition)                               \
  do {                                                           \
    if (!(condition)) [[unlikely]]                               \
      ::lenticule::check_failed(__FILE__, __LINE__, #condition); \
  } while (false)
