// SPDX-License-Identifier: Apache-2.0
#include "player/process/interrupt.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstring>

#include "base/unique_fd.h"
#include "display/kms/device/graphics_console.h"
#include "player/process/key_input.h"

namespace lenticule::player {
namespace {

std::atomic<int> g_signal{0};
std::atomic<const char*> g_text{nullptr};
std::atomic<bool> g_reloads{false};
std::atomic<bool> g_reload_wanted{false};
int g_pipe[2] = {-1, -1};

extern "C" void on_interrupt(int signal) {
  if (signal == SIGHUP && g_reloads.load()) {
    g_reload_wanted.store(true);
    return;
  }
  int none = 0;
  if (!g_signal.compare_exchange_strong(none, signal)) {
    if (signal == SIGHUP) return;  // the shell and the kernel send one each
    restore_terminal_now();
    display::restore_console_now();
    _exit(128 + signal);
  }
  const char byte = 1;
  [[maybe_unused]] ssize_t ignored = write(g_pipe[1], &byte, 1);
  if (const char* const text = g_text.load(); signal == SIGINT && text != nullptr)
    ignored = write(STDERR_FILENO, text, strlen(text));
}

}  // namespace

void install_interrupt_handlers() {
  if (g_pipe[0] < 0 && pipe2(g_pipe, O_CLOEXEC | O_NONBLOCK) != 0) g_pipe[0] = g_pipe[1] = -1;
  struct sigaction action {};
  action.sa_handler = on_interrupt;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  struct sigaction before {};
  if (sigaction(SIGHUP, nullptr, &before) == 0 && before.sa_handler != SIG_IGN)
    sigaction(SIGHUP, &action, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a write beyond the file size limit then fails like a full disk
}

bool has_terminal() noexcept {
  return static_cast<bool>(
      UniqueFd(::open("/dev/tty", O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)));
}

void reload_at_hangup() noexcept { g_reloads.store(true); }

bool take_reload_request() noexcept { return g_reload_wanted.exchange(false); }

void say_at_interrupt(const char* text) noexcept { g_text.store(text); }

int interrupt_signal() noexcept { return g_signal.load(std::memory_order_relaxed); }

int interrupt_fd() noexcept { return g_pipe[0]; }

bool wait_unless_interrupted(std::chrono::milliseconds duration) noexcept {
  pollfd entry{.fd = interrupt_fd(), .events = POLLIN, .revents = 0};
  (void)::poll(&entry, 1, static_cast<int>(duration.count()));
  return !interrupted();
}

ExitCode interrupt_exit_code() noexcept {
  switch (interrupt_signal()) {
    case 0:
      return kOk;
    case SIGHUP:
      return kHungUp;
    case SIGTERM:
      return kTerminated;
    default:
      return kInterrupted;
  }
}

}  // namespace lenticule::player
