// SPDX-License-Identifier: Apache-2.0
// A terminal that hands over every key at once instead of lines, and gives itself back on every way
// out.
#pragma once

namespace lenticule::player {

/// Only one at a time. Ctrl-C stays what it is; Ctrl-Z does nothing, for a stopped program would
/// leave the terminal like this. Restored by the destructor and by restore_terminal_now().
class RawTerminal {
 public:
  /// Throws Error(Failed) if `fd` is no terminal.
  explicit RawTerminal(int fd);
  ~RawTerminal();
  RawTerminal(const RawTerminal&) = delete;
  RawTerminal& operator=(const RawTerminal&) = delete;
};

/// For signal handlers that end the process; does nothing where nothing was changed.
void restore_terminal_now() noexcept;

}  // namespace lenticule::player
