// SPDX-License-Identifier: Apache-2.0
#include "player/interrupt.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <csignal>

#include "display/kms/graphics_console.h"
#include "player/raw_terminal.h"

namespace lenticule::player {
namespace {

std::atomic<int> g_signal{0};
int g_pipe[2] = {-1, -1};

extern "C" void on_interrupt(int signal) {
  int none = 0;
  if (!g_signal.compare_exchange_strong(none, signal)) {
    restore_terminal_now();
    display::restore_console_now();
    _exit(128 + signal);
  }
  const char byte = 1;
  [[maybe_unused]] const ssize_t ignored = write(g_pipe[1], &byte, 1);
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
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a write beyond a size limit fails like a full disk
}

int interrupt_signal() noexcept {
  return g_signal.load(std::memory_order_relaxed);
}

int interrupt_fd() noexcept {
  return g_pipe[0];
}

ExitCode interrupt_exit_code() noexcept {
  switch (interrupt_signal()) {
    case 0:
      return kOk;
    case SIGTERM:
      return kTerminated;
    default:
      return kInterrupted;
  }
}

}  // namespace lenticule::player
