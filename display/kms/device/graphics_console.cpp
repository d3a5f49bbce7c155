// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/graphics_console.h"

#include <fcntl.h>
#include <linux/kd.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <utility>

namespace lenticule::display {
namespace {

class KernelTerminalCalls final : public TerminalCalls {
 public:
  [[nodiscard]] int open_controlling_terminal() noexcept override {
    const int fd = open("/dev/tty", O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
    return fd < 0 ? -errno : fd;
  }
  void close(int fd) noexcept override { ::close(fd); }
  [[nodiscard]] bool is_foreground(int fd) noexcept override { return tcgetpgrp(fd) == getpgrp(); }
  [[nodiscard]] int get_mode(int fd, int& mode) noexcept override {
    return ioctl(fd, KDGETMODE, &mode) != 0 ? -errno : 0;
  }
  [[nodiscard]] int set_mode(int fd, int mode) noexcept override {
    return ioctl(fd, KDSETMODE, mode) != 0 ? -errno : 0;
  }
};

/// State for restore_console_now(). The thread that takes g_calls out restores the mode.
std::atomic<TerminalCalls*> g_calls{nullptr};
std::atomic<int> g_fd{-1};
std::atomic<int> g_mode{KD_TEXT};
static_assert(std::atomic<TerminalCalls*>::is_always_lock_free);

/// Signals that end a process by default.
constexpr std::array kDeadly = {SIGHUP, SIGINT, SIGQUIT, SIGILL,  SIGTRAP, SIGABRT,
                                SIGBUS, SIGFPE, SIGSEGV, SIGTERM, SIGSYS,  SIGXCPU};

extern "C" void restore_console_and_die(int signal) {
  restore_console_now();
  raise(signal);  // the kernel has restored the default action already
}

struct sigaction action_of(void (*handler)(int), int flags) {
  struct sigaction action {};
  action.sa_handler = handler;
  action.sa_flags = flags;
  sigemptyset(&action.sa_mask);
  return action;
}

/// Changes a signal's action, unless it was changed elsewhere before.
void replace_action(int signal, void (*from)(int), const struct sigaction& to) {
  struct sigaction current {};
  if (sigaction(signal, nullptr, &current) != 0 || current.sa_handler != from) return;
  sigaction(signal, &to, nullptr);
}

void catch_signals() {
  const auto die = action_of(restore_console_and_die, SA_RESETHAND | SA_NODEFER);
  for (const int signal : kDeadly) replace_action(signal, SIG_DFL, die);
  // A stopped player would keep the card, and the shell's prompt would stay invisible.
  replace_action(SIGTSTP, SIG_DFL, action_of(SIG_IGN, 0));
}

void release_signals() {
  const auto usual = action_of(SIG_DFL, 0);
  for (const int signal : kDeadly) replace_action(signal, restore_console_and_die, usual);
  replace_action(SIGTSTP, SIG_IGN, usual);
}

}  // namespace

std::shared_ptr<TerminalCalls> make_terminal_calls() {
  static auto* const calls = new KernelTerminalCalls;
  return {calls, [](TerminalCalls*) {}};
}

GraphicsConsole::GraphicsConsole(std::shared_ptr<TerminalCalls> calls) noexcept
    : calls_(std::move(calls)), fd_(calls_->open_controlling_terminal()) {
  if (fd_ >= 0) active_ = enter_graphics();
}

bool GraphicsConsole::enter_graphics() noexcept {
  if (!calls_->is_foreground(fd_)) return false;
  if (calls_->get_mode(fd_, found_mode_) != 0 || found_mode_ == KD_GRAPHICS) return false;
  if (calls_->set_mode(fd_, KD_GRAPHICS) != 0) return false;
  g_fd.store(fd_);
  g_mode.store(found_mode_);
  g_calls.store(calls_.get());
  catch_signals();
  return true;
}

GraphicsConsole::~GraphicsConsole() {
  if (active_) {
    restore_console_now();
    release_signals();
  }
  if (fd_ >= 0) calls_->close(fd_);
}

void restore_console_now() noexcept {
  if (TerminalCalls* const calls = g_calls.exchange(nullptr))
    (void)calls->set_mode(g_fd.load(), g_mode.load());
}

}  // namespace lenticule::display
