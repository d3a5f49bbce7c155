// SPDX-License-Identifier: Apache-2.0
// lenticule farm status shows how far a farm is, from the files of its work folder; and, if Slurm
// runs it, which tasks Slurm holds.
#include "farm/status.h"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <chrono>
#include <optional>
#include <string>
#include <utility>

#include "apps/lenticule-tools/farm/actions.h"
#include "apps/lenticule-tools/farm/slurm_programs.h"
#include "base/error.h"
#include "base/json_output.h"
#include "base/print.h"
#include "player/process/interrupt.h"

namespace lenticule::tools {
namespace {

constexpr int kWatchMilliseconds = 2000;

/// QueueLook asks Slurm for the film's tasks if they were submitted to it. The queue of a large
/// cluster costs its controller some work, so that --watch asks seldom.
class QueueLook {
 public:
  explicit QueueLook(const farm::WorkFolder& folder) : folder_(folder) {}

  /// Returns "slurm" of the JSON, and the same as lines. Without a submission, or after the merge,
  /// both are empty.
  [[nodiscard]] std::pair<nlohmann::json, std::string> look(const farm::FarmStatus& status) {
    if (status.complete() && status.merged) return {};
    const auto now = std::chrono::steady_clock::now();
    if (asked_ && now - *asked_ < kAskAgain) return answer_;
    asked_ = now;
    try {
      const auto jobs = submitted_jobs(folder_);
      if (!jobs) return answer_ = {};
      const farm::SlurmQueue queue = ask_slurm(*jobs, kSlurmLimit);
      answer_ = {farm::queue_json(queue), farm::queue_text(queue, folder_.path().string())};
    } catch (const Error& error) {  // the files still say how far the farm is
      answer_ = {{{"error", error.what()}}, fmt::format("Slurm: {}\n", escaped(error.what()))};
    }
    return answer_;
  }

 private:
  static constexpr std::chrono::seconds kAskAgain{20};
  static constexpr std::chrono::seconds kSlurmLimit{5};
  const farm::WorkFolder& folder_;
  std::optional<std::chrono::steady_clock::time_point> asked_;
  std::pair<nlohmann::json, std::string> answer_;
};

void print_status(const farm::FarmStatus& status, QueueLook& queue, bool json) {
  const auto [object, lines] = queue.look(status);
  if (json) {
    nlohmann::json out = farm::status_json(status);
    out["slurm"] = object;
    print_json(out);
  } else {
    print_out("{}{}", Verbatim{farm::status_text(status)}, Verbatim{lines});
  }
}

/// Waits; returns false if interrupted.
bool wait_for_next_look() {
  pollfd query{.fd = player::interrupt_fd(), .events = POLLIN, .revents = 0};
  (void)poll(&query, 1, kWatchMilliseconds);
  return !player::interrupted();
}

}  // namespace

ExitCode farm_status(const FarmStatusFlags& flags) {
  const farm::WorkFolder folder(flags.folder);
  QueueLook queue(folder);
  const bool terminal = isatty(STDOUT_FILENO) == 1;
  while (true) {
    const farm::FarmStatus status = farm::read_status(folder, farm::folder_time(folder.path()));
    if (flags.watch && terminal && !flags.json) print_out("{}", Verbatim{"\x1b[H\x1b[2J"});
    print_status(status, queue, flags.json);
    if (!flags.watch || status.complete()) return kOk;
    flush_results();
    if (!wait_for_next_look()) return player::interrupt_exit_code();
  }
}

}  // namespace lenticule::tools
