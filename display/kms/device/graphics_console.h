// SPDX-License-Identifier: Apache-2.0
// GraphicsConsole silences the kernel's text console while frames are shown: no text, cursor or
// blanking on the virtual terminal that started the program.
#pragma once

#include <memory>

namespace lenticule::display {

/// System calls on terminals. They return a descriptor or 0, or a negative errno.
class TerminalCalls {
 public:
  virtual ~TerminalCalls() = default;
  [[nodiscard]] virtual int open_controlling_terminal() noexcept = 0;
  virtual void close(int fd) noexcept = 0;
  /// Returns true if this process is in the terminal's foreground and so receives its keys.
  [[nodiscard]] virtual bool is_foreground(int fd) noexcept = 0;
  /// Reads KD_TEXT or KD_GRAPHICS; only virtual terminals have a mode.
  [[nodiscard]] virtual int get_mode(int fd, int& mode) noexcept = 0;
  /// Async-signal-safe.
  [[nodiscard]] virtual int set_mode(int fd, int mode) noexcept = 0;
};

/// Returns the kernel's calls; the object is never freed, so that a signal handler may use it at
/// any time.
[[nodiscard]] std::shared_ptr<TerminalCalls> make_terminal_calls();

/// Sets graphics mode during its lifetime and text mode afterwards, also when the process ends by
/// an unhandled signal. Does nothing, without an error, if there is no virtual terminal, no
/// permission, the process is in the background, or another program has already set graphics mode.
///
/// Meanwhile the kernel ignores the keys that switch terminals, and Ctrl-Z does nothing; Ctrl-C
/// works as usual. Only one object may exist per process. Thread safety: constructed and destroyed
/// on one thread.
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

/// Sets text mode at once if a GraphicsConsole exists, for handlers that end the process without
/// destructors. Async-signal-safe.
void restore_console_now() noexcept;

}  // namespace lenticule::display
