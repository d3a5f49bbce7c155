// SPDX-License-Identifier: Apache-2.0
// PlayRun is one run of `lenticule play` from the plan to the exit code: it opens source and
// display, plays, reconnects a lost panel, and reports to the user, the service manager and control
// clients.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "base/error.h"
#include "base/exit_code.h"
#include "display/kms/scanout/kms_display.h"
#include "player/playback/playback.h"
#include "player/proof/proof_of_play.h"
#include "player/session/panel_wait.h"
#include "player/session/play_outputs.h"
#include "player/session/play_plan.h"
#include "player/session/play_service.h"
#include "player/session/preview_window.h"
#include "player/session/steered_play.h"
#include "player/sources/open_source.h"

namespace lenticule::player {

/// Safe mode, after failed starts or on request: takes over no previous output, requests no
/// real-time priority, and shows a test card with the reason while the source cannot be played.
struct SafeStart {
  bool on = false;
  /// Shows the card before the source is tried at all, because the source may be the cause of the
  /// crashes.
  bool card_first = false;
  int failures = 0;
  std::string last_reason{};
};

/// Thread safety: one thread.
class PlayRun {
 public:
  PlayRun(const PlayFlags& flags, PlayPlan plan, const ServiceManager& manager, SafeStart safe);

  ~PlayRun();
  PlayRun(const PlayRun&) = delete;
  PlayRun& operator=(const PlayRun&) = delete;

  /// Runs once. Throws Error for a failure that ends the run.
  ExitCode run();

 private:
  // Display.
  void open_window();
  void open_display();
  void open_panel();
  [[nodiscard]] ReconnectResult reconnect(const LostDisplay& lost);
  void report_waiting(const PanelWaiting& waiting);
  void release_stored();

  // Playback.
  void open_the_source();
  [[nodiscard]] PlayResult play_source();
  [[nodiscard]] PlayResult play_card();
  [[nodiscard]] PlayResult play_on_display(frames::FrameSource& source, PlaybackOptions options);
  [[nodiscard]] bool continues_after(const PlayResult& result);
  [[nodiscard]] std::optional<uint64_t> vblanks_left() const;
  [[nodiscard]] bool time_is_over() const;

  // Files that are read and written meanwhile.
  void look_after_files();
  void update_proof();
  void copy_edited_rig(bool reloading = false);
  void follow_rig();
  void reload();

  // Reports.
  void report_exactness();
  void report_power(const PlayReport& report);
  void report_stall(const PlayReport& report);
  void announce();
  void write_stats(nlohmann::ordered_json statistics);
  [[nodiscard]] nlohmann::ordered_json statistics_json(const PlayReport& report) const;
  [[nodiscard]] PlayReport nothing_yet(const char* outcome) const;

  // End of the run.
  [[nodiscard]] ExitCode conclude(const PlayResult& result);
  [[nodiscard]] ExitCode exit_code_after(const PlayResult& result) const;
  [[nodiscard]] Error list_error(const std::string& why) const;
  [[nodiscard]] Error source_error(const PlayResult& result) const;
  [[nodiscard]] Error lost_display() const;

  const PlayFlags& flags_;
  PlayPlan plan_;
  const ServiceManager& manager_;
  const SafeStart safe_;

  PlayOutputs outputs_;
  std::optional<SteeredPlay> steered_;
  OpenedSource opened_;                ///< destroyed before steered_, which controls it
  std::optional<Error> source_error_;  ///< safe mode: why the source is not played
  display::Nanoseconds card_time_;  ///< display time of the card before the source is tried again
  std::optional<PanelWait> panel_;
  std::shared_ptr<PreviewWindow> window_;  ///< null without --display window
  std::optional<PlayProof> proof_;         ///< none without --proof journal
  std::unique_ptr<display::Display> display_;
  display::KmsDisplay* kms_ = nullptr;  ///< display_, if it is a KMS display
  std::optional<PlayService> service_;
  std::optional<display::Nanoseconds> end_;  ///< end of the requested time, display clock
  bool kept_ = false;  ///< the service manager holds a copy of the card's descriptor
  std::optional<TrimKeys> trim_keys_;
  std::optional<StepLink> step_;  ///< none without --step
  std::string rig_problem_;
  std::string store_problem_;  ///< why an edited rig was not copied
  std::string reported_exactness_;
  bool reported_off_ = false;
  std::string stall_;  ///< why a due frame has not come for two seconds; empty if none is due
  std::chrono::steady_clock::time_point stall_begin_;
  std::string reported_;  ///< the reported reason for waiting; each is reported once
  PlayReport lost_;       ///< the report while waiting for a panel
};

}  // namespace lenticule::player
