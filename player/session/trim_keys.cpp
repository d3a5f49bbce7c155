// SPDX-License-Identifier: Apache-2.0
#include "player/session/trim_keys.h"

#include <poll.h>
#include <unistd.h>

#include <array>
#include <utility>

#include "base/error.h"
#include "base/print.h"

namespace lenticule::player {
namespace {

std::unique_ptr<KeyInput> terminal_keys() {
  if (isatty(STDIN_FILENO) != 1)
    throw Error(ErrorKind::Usage, "--trim: standard input is not a terminal",
                "use lenticule rig trim RIG --offset-by 0.01");
  return open_key_input({});
}

}  // namespace

TrimKeys::TrimKeys(std::shared_ptr<LiveTrim> trim)
    : trim_(std::move(trim)), keys_(terminal_keys()) {
  thread_ = std::thread([this] { listen(); });
}

TrimKeys::~TrimKeys() {
  ending_.store(true);
  wake_.signal();
  thread_.join();
}

void TrimKeys::listen() noexcept {
  while (!ending_.load() && !keys_->at_end()) {
    std::array<pollfd, 2> ready{{{.fd = keys_->fd(), .events = POLLIN, .revents = 0},
                                 {.fd = wake_.fd(), .events = POLLIN, .revents = 0}}};
    (void)poll(ready.data(), ready.size(), static_cast<int>(kEscapePause.count()));
    for (const KeyPress& press : keys_->take()) report(trim_->press(press));
  }
}

/// Prints a sentence on a line of its own, over a progress line.
void TrimKeys::report(const std::string& sentence) {
  if (sentence.empty()) return;
  say("\r\x1b[K{}\n", sentence);
  const std::string advice = trim_->advice();
  if (!advice.empty() && !std::exchange(advised_, true)) say("{}\n", advice);
}

}  // namespace lenticule::player
