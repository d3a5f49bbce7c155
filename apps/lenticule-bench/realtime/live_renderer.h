// SPDX-License-Identifier: Apache-2.0
// The renderer of `lenticule bench realtime`: a process that renders a moving scene as fast as it
// can into the ring of a player, always the frame that is due.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "apps/lenticule-bench/realtime/run_log.h"
#include "apps/lenticule-bench/render/bench_error.h"
#include "base/unique_fd.h"
#include "frames/rational.h"
#include "optics/rig.h"

namespace lenticule::bench {

struct LiveSetup {
  std::string scene;  ///< as ErrorScene takes it
  optics::Rig rig;
  ErrorEntrant entrant;
  double seconds = 60.0;
  frames::Rate fps{30, 1};  ///< frames of the scene per second
  int threads = 0;          ///< 0 = all cores
  int depth = 5;
  /// Frames per second for which the renderer chooses the tolerated error of each frame.
  std::optional<double> adapt_rate = {};
  int samples = 5;  ///< frames to compare with method full after the run
};

/// Returns the largest number of scene frames that the run can reach.
[[nodiscard]] uint64_t most_frames(const LiveSetup& setup);

/// RendererProcess is the running renderer. Its messages are
///   {"failed": TEXT, "hint": TEXT, "kind": NUMBER}, before or during the run, and nothing else; or
///   {"sample": {"frame", "number", "tolerated_error", "mse", "max"}} for each sample after the
///   player has finished, and last {"finished": true}.
///
/// Thread safety: one thread.
class RendererProcess {
 public:
  /// Starts the process, which waits for a player at `socket`. This process must not have other
  /// threads. Throws Error(Failed).
  RendererProcess(const LiveSetup& setup, const std::filesystem::path& socket, RunLog& log);
  /// Kills the process if it still runs.
  ~RendererProcess();
  RendererProcess(const RendererProcess&) = delete;
  RendererProcess& operator=(const RendererProcess&) = delete;

  /// Returns a descriptor that is readable when there is a message or the process has ended.
  [[nodiscard]] int message_fd() const { return messages_.get(); }
  /// Returns the next message; none when the process has ended, when it is silent for ten minutes,
  /// or some seconds after an interruption.
  [[nodiscard]] std::optional<nlohmann::json> next_message();

 private:
  UniqueFd messages_;
  std::string unread_;
  pid_t pid_ = -1;
};

}  // namespace lenticule::bench
