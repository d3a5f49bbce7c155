// SPDX-License-Identifier: Apache-2.0
// PlayControls carries out the requests that arrive on a running player's control socket.
#pragma once

#include <condition_variable>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "optics/rig.h"
#include "player/control/control_server.h"
#include "player/control/frame_memory.h"
#include "player/playback/playback.h"
#include "player/playlist/playlist_source.h"
#include "player/sources/live_trim.h"

namespace lenticule::player {

/// Reads the list or single source that `load` names. Throws Error. Called on the worker thread of
/// PlayControls.
using PlaylistReader = std::function<Playlist(const std::string& source)>;

/// WallPanel is one of the panels that a player shows together.
struct WallPanel {
  std::string name;
  frames::FrameGeometry size;
  optics::Rig rig;
};

struct PlayControlsOptions {
  frames::FrameGeometry panel = {};
  std::vector<WallPanel> wall = {};  ///< empty for a player of one panel
  PlaylistReader read_playlist;
  std::shared_ptr<LiveTrim> trim;  ///< null for a wall
  /// Ends the player in an orderly way. Thread safety: any thread.
  std::function<void()> quit;
};

/// Thread safety: handle() runs on the server's thread; all other functions on the player's main
/// thread.
class PlayControls final : public ControlTarget {
 public:
  explicit PlayControls(PlayControlsOptions options);
  ~PlayControls() override;
  PlayControls(const PlayControls&) = delete;
  PlayControls& operator=(const PlayControls&) = delete;

  void handle(const ControlRequest& request, ControlRights rights,
              std::function<void(ControlAnswer)> answer) override;

  /// Returns the object by which the playback is controlled.
  [[nodiscard]] PlaybackControl& playback() { return playback_; }
  /// Sets the playlist that is controlled from now on; null while there is none. Lifetime: `source`
  /// must stay valid until the next call.
  void steer(PlaylistSource* source);
  /// Stores the newest statistics, and a one-word state of the player, for later requests.
  void report_statistics(const nlohmann::ordered_json& statistics);
  void report_state(const std::string& state);

 private:
  using Answer = std::function<void(ControlAnswer)>;

  [[nodiscard]] nlohmann::ordered_json status() const;
  [[nodiscard]] nlohmann::ordered_json statistics() const;
  [[nodiscard]] nlohmann::ordered_json doctor() const;
  [[nodiscard]] nlohmann::ordered_json pause(bool paused);
  [[nodiscard]] nlohmann::ordered_json set_loops(uint64_t loops);
  [[nodiscard]] nlohmann::ordered_json change_trim(const ControlRequest& request);
  [[nodiscard]] nlohmann::ordered_json replace_rig(const ControlRequest& request);
  void jump(Jump where, const Answer& answer);
  void load(const ControlRequest& request, const Answer& answer);
  void interrupt(const ControlRequest& request, const Answer& answer);
  void blank(const Answer& answer);
  void back(const Answer& answer);
  void cue(const ControlRequest& request, const Answer& answer);
  void go(const Answer& answer);
  [[nodiscard]] std::shared_ptr<const Playlist> interruption_of(
      const ControlRequest& request) const;
  [[nodiscard]] nlohmann::ordered_json set_speed(uint32_t permille);
  [[nodiscard]] nlohmann::ordered_json switch_output(bool on);
  void snapshot(const ControlRequest& request, const Answer& answer);
  [[nodiscard]] nlohmann::ordered_json take_snapshot(const ControlRequest& request);
  [[nodiscard]] DescriptorAnswer share_frame();
  [[nodiscard]] nlohmann::ordered_json list(const ControlRequest& request) const;
  void work_on(Answer answer, std::function<void(const Answer&)> task);
  void work() noexcept;
  [[nodiscard]] nlohmann::ordered_json trim_json(const optics::Trim& trim) const;

  const PlayControlsOptions options_;
  PlaybackControl playback_;

  mutable std::mutex mutex_;  ///< guards the members below
  PlaylistSource* source_ = nullptr;
  nlohmann::ordered_json statistics_;
  std::string state_ = "starting";

  std::unique_ptr<FrameMemory> frame_memory_;  ///< used by the worker thread

  // Slow tasks (reading lists, encoding pictures), run one after the other.
  struct Task {
    Answer answer;
    std::function<void(const Answer&)> run;
  };
  std::mutex tasks_mutex_;
  std::condition_variable task_there_;
  std::deque<Task> tasks_;
  bool stopping_ = false;
  std::thread worker_;  // last member
};

}  // namespace lenticule::player
