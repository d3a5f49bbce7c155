// SPDX-License-Identifier: Apache-2.0
// SteeredPlay adds playlists and a control socket to a run of `lenticule play`.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>

#include "player/control/control_server.h"
#include "player/playlist/playlist_source.h"
#include "player/playlist/source_pace.h"
#include "player/session/play_plan.h"
#include "player/sources/live_rig.h"

namespace lenticule::player {

class PlayControls;

/// Only measures the source's pace if the source is plain, without control socket and proof. Thread
/// safety: the player's main thread.
class SteeredPlay {
 public:
  /// Starts to listen. Throws as ControlServer does.
  SteeredPlay(const PlayFlags& flags, const PlayPlan& plan);
  ~SteeredPlay();
  SteeredPlay(const SteeredPlay&) = delete;
  SteeredPlay& operator=(const SteeredPlay&) = delete;

  /// Opens the source as open_source() does, after it has closed the one in `opened`.
  void open(OpenedSource& opened);
  /// Detaches from the source; call it before the source is destroyed.
  void detach_source();
  /// Sets the playback options that lists and control need.
  void prepare(PlaybackOptions& options, frames::Rate refresh);
  /// Switches the output off after the first frame, as it was in the previous player.
  void begin_off();
  /// Checks the list's and the item's files now.
  void look_again() {
    if (source_ != nullptr) source_->look_again();
  }
  /// Sets the state, one word; publishes an event if it changed.
  void report_state(const std::string& state);
  /// Call about once a second: updates the statistics, warns, and publishes events.
  void report(const PlayReport& report);
  void complete(nlohmann::ordered_json& statistics);
  /// Returns the account of an item's turn, if it is remembered.
  [[nodiscard]] std::optional<ItemAccount> account_of(uint64_t item) const {
    return source_ == nullptr ? std::nullopt : source_->account_of(static_cast<uint32_t>(item));
  }
  /// Returns why the playback failed: an only item that failed, or a list without a playable item.
  /// Empty otherwise.
  [[nodiscard]] std::string failure() const;

 private:
  void listen();
  void on_item(const PlaylistEvent& event);
  void complain(const std::string& how, const PlaylistEvent& event);
  void publish(nlohmann::ordered_json event);
  void publish_changes(const PlayReport& report);

  const PlayFlags& flags_;
  const PlayPlan& plan_;
  const bool is_list_;
  std::unique_ptr<PlayControls> controls_;
  std::unique_ptr<ControlServer> server_;
  std::atomic<ControlServer*> serving_{nullptr};  ///< server_, for all threads
  RetriedWrites listening_;                       ///< retries to open the socket
  PlaylistSource* source_ = nullptr;
  SourcePace pace_;
  PlayReport before_;
  uint64_t trim_version_ = 0;
  std::string state_;
  std::mutex reported_mutex_;
  std::set<std::string> reported_;  ///< complaints already printed; each is printed once
};

}  // namespace lenticule::player
