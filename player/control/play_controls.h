// SPDX-License-Identifier: Apache-2.0
// PlayControls carries out the requests that arrive on a running player's control socket.
#pragma once

#include <sys/mman.h>

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "base/unique_fd.h"
#include "frames/frame.h"
#include "optics/rig.h"
#include "player/control/control_server.h"
#include "player/playback/playback.h"
#include "player/playlist/playlist.h"
#include "player/playlist/playlist_source.h"
#include "player/sources/live_rig.h"

namespace lenticule::player {

/// FrameMemory shares a copy of the displayed frame with clients of the control socket. All clients
/// share one memory, so that no number of requests takes more.
/// Layout: a serial number (8 bytes, in the order of this machine), then at offset 64 the pixels,
/// then the text. The serial number is 0 while the content changes.
///
/// Thread safety: one thread.
class FrameMemory {
 public:
  static constexpr size_t kPixelsAt = 64;
  static constexpr size_t kMaxText = size_t{8} << 20;

  /// Throws Error(Failed) if there is no memory.
  explicit FrameMemory(const frames::FrameGeometry& geometry);
  ~FrameMemory() { ::munmap(bytes_, kPixelsAt + pixels_ + kMaxText); }
  FrameMemory(const FrameMemory&) = delete;
  FrameMemory& operator=(const FrameMemory&) = delete;

  /// Replaces the content and returns its serial number. Throws Error(Failed) for a text longer
  /// than kMaxText.
  uint64_t write(const frames::WovenFrame& frame, std::string_view text);
  /// Returns the descriptor to pass on. Others can map it for reading only.
  [[nodiscard]] const std::shared_ptr<const UniqueFd>& descriptor() const { return fd_; }

 private:
  std::shared_ptr<const UniqueFd> fd_;
  uint8_t* bytes_ = nullptr;
  size_t pixels_ = 0;
  uint64_t serial_ = 0;
};

/// Describes a playlist to clients of the control socket, with the keys of its file: returns
/// {"file", "loop", "default", "count", "first", "items"}: the items from `first` on, at
/// least one if there is one, and more as long as their text is shorter than `most_bytes`.
[[nodiscard]] nlohmann::ordered_json list_json(const Playlist& list, size_t first,
                                               size_t most_bytes = size_t{32} << 10);

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
  std::shared_ptr<LiveRig> trim;  ///< null for a wall
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
  [[nodiscard]] nlohmann::ordered_json trim_json(const optics::Trim& trim) const {
    return {{"offset_lenses", trim.offset.value}, {"pitch_relative", trim.pitch_relative}};
  }

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
