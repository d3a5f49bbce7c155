// SPDX-License-Identifier: Apache-2.0
// What lists and a control socket add to a run of `lenticule play`.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>

#include "player/control/control_server.h"
#include "player/control/play_controls.h"
#include "player/playlist/playlist_source.h"
#include "player/playlist/source_pace.h"
#include "player/session/play_plan.h"

namespace lenticule::player {

/// The list that is played: a file's, or one of a single source. Throws Error.
[[nodiscard]] Playlist read_playlist(const std::string& source, const PlayFlags& flags,
                                     const PlayPlan& plan);
/// Opens items as the plan's source would be opened.
[[nodiscard]] ItemOpener item_opener(const SourceRequest& like);

/// Looks at items' files; the plan's flags are about its own source.
[[nodiscard]] ItemLook item_look(const SourceRequest& like);

/// On the player's main thread. Does nothing but watch the source's pace for a plain source without
/// a control socket.
class SteeredPlay {
 public:
  /// Listens from now on. Throws as ControlServer does. `advice` goes with every trim.
  SteeredPlay(const PlayFlags& flags, const PlayPlan& plan, const std::string& advice);
  ~SteeredPlay();
  SteeredPlay(const SteeredPlay&) = delete;
  SteeredPlay& operator=(const SteeredPlay&) = delete;

  /// As open_source(); `before` is what was opened before, and goes.
  void open(OpenedSource& opened);
  /// Before the source is destroyed.
  void let_go();
  /// What the playback is to know.
  void prepare(PlaybackOptions& options, frames::Rate refresh);
  /// Looks at the list's and the item's files now.
  void look_again();
  /// One word, and as an event if it changed.
  void tell_state(const std::string& state);
  /// About once a second: adds to the statistics, warns, tells those who listen.
  void report(const PlayReport& report);
  void complete(nlohmann::ordered_json& statistics);
  /// Empty unless the end was not the list's but its only item's, or nothing could be played.
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
  RetriedWrites listening_;                       ///< tries to have the socket
  PlaylistSource* source_ = nullptr;
  SourcePace pace_;
  PlayReport before_;
  uint64_t trim_version_ = 0;
  std::string state_;
  std::mutex told_mutex_;
  std::set<std::string> told_;  ///< complaints, each made once
};

}  // namespace lenticule::player
