// SPDX-License-Identifier: Apache-2.0
// lenticule farm status shows how far a farm is.
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include "apps/lenticule-tools/farm/farm_actions.h"
#include "base/json_output.h"
#include "base/print.h"
#include "farm/status.h"
#include "player/process/interrupt.h"

namespace lenticule::player {
namespace {

constexpr int kWatchMilliseconds = 2000;

void print_status(const farm::FarmStatus& status, bool json) {
  if (json) {
    print_json(farm::status_json(status));
  } else {
    print_out("{}", Verbatim{farm::status_text(status)});
  }
}

/// Waits; returns false if interrupted.
bool wait_for_next_look() {
  pollfd query{.fd = interrupt_fd(), .events = POLLIN, .revents = 0};
  (void)poll(&query, 1, kWatchMilliseconds);
  return !interrupted();
}

}  // namespace

ExitCode farm_status(const FarmStatusFlags& flags) {
  const farm::WorkFolder folder(flags.folder);
  const bool terminal = isatty(STDOUT_FILENO) == 1;
  while (true) {
    const farm::FarmStatus status = farm::read_status(folder, farm::folder_time(folder.path()));
    if (flags.watch && terminal && !flags.json) print_out("{}", Verbatim{"\x1b[H\x1b[2J"});
    print_status(status, flags.json);
    if (!flags.watch || status.complete()) return kOk;
    flush_results();
    if (!wait_for_next_look()) return interrupt_exit_code();
  }
}

}  // namespace lenticule::player
