// SPDX-License-Identifier: Apache-2.0
// KeyInput delivers key presses from a person at a terminal or from a script that simulates one.
#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "base/terminal_keys.h"

namespace lenticule::player {

/// RawTerminal makes a terminal deliver every key at once instead of lines, and restores it however
/// the process ends.
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

/// Thread safety: one thread.
class KeyInput {
 public:
  virtual ~KeyInput() = default;

  /// Returns the keys pressed since the last call, in order; does not wait.
  [[nodiscard]] virtual std::vector<KeyPress> take() = 0;
  /// Returns true if no more keys will come.
  [[nodiscard]] virtual bool at_end() const = 0;
  /// Returns a descriptor that is readable when there may be keys; -1 if there is no need to wait.
  [[nodiscard]] virtual int fd() const = 0;
  /// Returns true if a person reads the printed output.
  [[nodiscard]] virtual bool is_person() const = 0;
};

/// Time after which an escape is the escape key and not the start of an arrow key.
inline constexpr std::chrono::milliseconds kEscapePause{60};

/// Opens the file named `script`; if empty, standard input, read as keys if it is a terminal and as
/// a script otherwise. Throws Error(Input) for a script that cannot be read or is larger than 1
/// MiB.
[[nodiscard]] std::unique_ptr<KeyInput> open_key_input(const std::string& script);

}  // namespace lenticule::player
