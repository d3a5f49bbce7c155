// SPDX-License-Identifier: Apache-2.0
// One run of `lenticule play`, from the plan to the exit code: opens source and display, plays,
// waits for a panel that is lost, tells whoever wants to know.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/exit_code.h"
#include "display/kms/scanout/kms_display.h"
#include "player/playback/playback.h"
#include "player/session/panel_wait.h"
#include "player/session/play_plan.h"
#include "player/session/play_service.h"
#include "player/session/service_manager.h"
#include "player/session/statistics_file.h"
#include "player/session/steered_play.h"
#include "player/session/trim_keys.h"
#include "player/sources/source_open.h"

namespace lenticule::player {

/// Starting with care, after starts that failed or because somebody asked for it: nothing is taken
/// over from a player before, no real-time priority, and what cannot be played becomes a test card
/// with the reason until it can.
struct SafeStart {
  bool on = false;
  /// The source is not even tried at first: it may be what ends every player.
  bool card_first = false;
  int failures = 0;
  std::string last_reason{};
};

/// One thread.
class PlayRun {
 public:
  PlayRun(const PlayFlags& flags, PlayPlan plan, const ServiceManager& manager, SafeStart safe);

  ~PlayRun();
  PlayRun(const PlayRun&) = delete;
  PlayRun& operator=(const PlayRun&) = delete;

  /// Once. Throws Error for what ends the run.
  ExitCode run();

 private:
  // The display.
  void open_display();
  void open_panel();
  [[nodiscard]] Comeback bring_back(const LostDisplay& lost);
  void tell_waiting(const PanelWaiting& waiting);
  void let_go();

  // Playing.
  void open_the_source();
  [[nodiscard]] PlayResult play_source();
  [[nodiscard]] PlayResult play_card();
  [[nodiscard]] PlayResult play_on_display(frames::FrameSource& source, PlaybackOptions options);
  [[nodiscard]] bool goes_on_after(const PlayResult& result);
  [[nodiscard]] std::optional<uint64_t> vblanks_left() const;
  [[nodiscard]] bool time_is_over() const;

  // Files beside the film.
  struct WrittenFile {
    std::string name;
    WriteState state;
  };
  [[nodiscard]] std::vector<WrittenFile> written_files();
  void look_after_files();
  void tell_write_trouble();
  void follow_rig();
  void reload();

  // Telling.
  void tell_exactness();
  void announce();
  void write_stats(nlohmann::ordered_json statistics);
  [[nodiscard]] nlohmann::ordered_json statistics_json(const PlayReport& report) const;
  [[nodiscard]] PlayReport nothing_yet(const char* outcome) const;

  // The end.
  [[nodiscard]] nlohmann::ordered_json finish_recording();
  void finish_statistics(const nlohmann::ordered_json& statistics);
  [[nodiscard]] ExitCode conclude(const PlayResult& result);
  [[nodiscard]] ExitCode exit_code_after(const PlayResult& result) const;
  [[nodiscard]] Error list_trouble(const std::string& why) const;
  [[nodiscard]] Error source_trouble(const PlayResult& result) const;
  [[nodiscard]] Error lost_display() const;

  const PlayFlags& flags_;
  PlayPlan plan_;
  const ServiceManager& manager_;
  const SafeStart safe_;

  std::optional<SteeredPlay> steered_;
  OpenedSource opened_;             ///< goes before what steers it
  std::optional<Error> trouble_;    ///< of a safe start: why the source is not played
  display::Nanoseconds card_time_;  ///< before it is tried again
  std::optional<PanelWait> panel_;
  std::unique_ptr<display::Display> display_;
  display::KmsDisplay* kms_ = nullptr;  ///< display_, if it is one
  std::optional<PlayService> service_;
  std::optional<display::Nanoseconds> end_;  ///< of the time asked for, display clock
  bool kept_ = false;                        ///< the manager has a copy of the card
  std::optional<TrimKeys> trim_keys_;
  std::optional<StatisticsFile> stats_file_;
  std::set<std::string> cannot_write_;  ///< names of files of which it was said
  std::string rig_trouble_;
  uint64_t rig_version_ = 1;
  /// What is not whole at the end although it was asked for.
  std::optional<Error> output_trouble_;
  std::string told_exactness_;
  std::string told_;  ///< why it waits, said once
  PlayReport lost_;   ///< while a panel is waited for
};

}  // namespace lenticule::player
