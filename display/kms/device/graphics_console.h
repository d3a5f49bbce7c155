// SPDX-License-Identifier: Apache-2.0
// Keeps the kernel's text console quiet while frames are shown: no text, cursor or blanking on the
// virtual terminal that the program was started from.
#pragma once

#include <memory>

namespace lenticule::display {

/// System calls on terminals. Descriptors and 0, or a negative errno.
class TerminalCalls {
 public:
  virtual ~TerminalCalls() = default;
  [[nodiscard]] virtual int open_controlling_terminal() noexcept = 0;
  virtual void close(int fd) noexcept = 0;
  /// Whether keys reach this process: it is in the terminal's foreground.
  [[nodiscard]] virtual bool is_foreground(int fd) noexcept = 0;
  /// KD_TEXT or KD_GRAPHICS; only virtual terminals have a mode.
  [[nodiscard]] virtual int get_mode(int fd, int& mode) noexcept = 0;
  /// Async-signal-safe.
  [[nodiscard]] virtual int set_mode(int fd, int mode) noexcept = 0;
};

/// The kernel's; never freed, so that a signal handler may use them at any time.
[[nodiscard]] std::shared_ptr<TerminalCalls> make_terminal_calls();

/// Graphics mode for as long as it lives, and text mode again afterwards, also when the process
/// ends by a signal that nobody handles. Does nothing, and does not fail, without a virtual
/// terminal, without permission, in the background, or where somebody else has set graphics mode
/// already.
///
/// Meanwhile the kernel ignores the keys that switch terminals, and Ctrl-Z does nothing; Ctrl-C
/// works as ever. One at a time per process; made and destroyed on one thread.
class GraphicsConsole {
 public:
  explicit GraphicsConsole(std::shared_ptr<TerminalCalls> calls) noexcept;
  ~GraphicsConsole();
  GraphicsConsole(const GraphicsConsole&) = delete;
  GraphicsConsole& operator=(const GraphicsConsole&) = delete;

  [[nodiscard]] bool active() const noexcept { return active_; }

 private:
  [[nodiscard]] bool enter_graphics() noexcept;

  std::shared_ptr<TerminalCalls> calls_;
  int fd_ = -1;
  int found_mode_ = 0;
  bool active_ = false;
};

/// Text mode at once, if a GraphicsConsole lives: for handlers that end the process without
/// destructors. Async-signal-safe.
void restore_console_now() noexcept;

}  // namespace lenticule::display
