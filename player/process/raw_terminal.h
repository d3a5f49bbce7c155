// SPDX-License-Identifier: Apache-2.0
// RawTerminal makes a terminal deliver every key at once instead of lines, and restores it however
// the process ends.
#pragma once

namespace lenticule::player {

/// Only one object may exist at a time. Ctrl-C still interrupts; Ctrl-Z is disabled, because a
/// stopped program would leave the terminal in raw mode. The destructor and restore_terminal_now()
/// restore the terminal.
class RawTerminal {
 public:
  /// Throws Error(Failed) if `fd` is not a terminal.
  explicit RawTerminal(int fd);
  ~RawTerminal();
  RawTerminal(const RawTerminal&) = delete;
  RawTerminal& operator=(const RawTerminal&) = delete;
};

/// Restores the terminal from a signal handler that ends the process; does nothing if the terminal
/// is unchanged.
void restore_terminal_now() noexcept;

}  // namespace lenticule::player
