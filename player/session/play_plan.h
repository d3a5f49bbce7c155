// SPDX-License-Identifier: Apache-2.0
// PlayFlags holds the flags of `lenticule play`; make_plan checks them and turns them into a
// PlayPlan before any source or display is opened.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "display/open/open_display.h"
#include "optics/rig_file.h"
#include "player/playback/playback.h"
#include "player/playlist/folder_lists.h"
#include "player/playlist/open_item.h"
#include "player/session/play_service.h"
#include "player/sound/sound_player.h"
#include "player/sources/live_rig.h"
#include "player/sources/open_source.h"
#include "player/step/step_link.h"

namespace lenticule::player {

/// The values given on the command line.
struct PlayFlags {
  std::string source;
  std::string rig;
  std::string wall;  ///< wall file instead of a rig, for several panels of one card
  std::string rig_store;
  std::string display = "virtual";
  bool display_named = false;  ///< --display was given
  bool rig_of_film = false;    ///< `rig` is a copy of the rig that the film contains
  std::string clock = "real";
  std::string fps;
  std::string loop;
  std::string late = "slip";
  std::string frames;
  ContentFlags content;
  WeavingFlags weaving;
  std::string record;
  std::string stats;
  std::string wait;  ///< empty: forever if faults end no player, else 60 s
  std::string wait_for_panel;
  std::string on_exit;
  std::string video_decoder = "auto";  ///< or "software"
  bool allow_inexact = false;
  std::optional<double> duration_s;
  std::optional<uint64_t> prime;
  int slots = 8;
  int buffers = 3;
  std::string control;
  std::string control_group;
  std::string proof;  ///< "journal", "off", or empty
  std::optional<int> memory_mib;
  std::string sound;         ///< file with sound, "none", or empty: as found
  std::string sound_device;  ///< empty: auto on panels and windows, else none
  std::string sound_track;
  std::optional<double> sound_delay_ms;
  double volume_db = 0.0;
  std::string step;  ///< name of the group
  bool leader = false;
  bool follow = false;
  std::string step_address;
  std::string step_key;
  bool preflight = false;
  bool safe = false;
  bool trim = false;
  bool json = false;
  std::chrono::steady_clock::time_point started = std::chrono::steady_clock::now();

  /// Returns the file that describes the panel or the panels.
  [[nodiscard]] const std::string& rig_or_wall() const { return wall.empty() ? rig : wall; }
};

/// Prints one line if no display was named, because the virtual display shows nothing. Throws
/// Error(Usage) if a panel was clearly intended: for a service, and with flags that concern panels.
void check_display_choice(const PlayFlags& flags, bool service);

struct PlayPlan {
  std::shared_ptr<FolderLists> folders = std::make_shared<FolderLists>();
  std::optional<optics::RigStore> rig_store;  ///< none without --rig-store
  /// Null unless the trim can change while playing, or the rig's own views may be played.
  std::shared_ptr<LiveRig> trim;
  SourceSpec source;
  OpenContext context;
  std::string rig_file;  ///< empty for a wall
  display::DisplayRequest display;
  /// A desktop window shows what two eyes see of the display, which is virtual.
  bool window = false;
  PlaybackOptions playback;
  std::shared_ptr<SoundPlayer> sound;
  /// Timeouts for the panel; none = wait forever.
  std::optional<display::Nanoseconds> panel_at_start;
  std::optional<display::Nanoseconds> panel_after_loss;
  /// Faults of files do not end a player that repeats them or is controlled.
  bool outlasts_faults = false;
  std::optional<double> duration_s;
  std::optional<gid_t> control_group;
  bool proof = false;               ///< writes the proof of play to the journal
  std::optional<StepOptions> step;  ///< none without --step
};

/// Returns how long to wait for the panel at the start; none = forever. Throws Error(Usage).
[[nodiscard]] std::optional<display::Nanoseconds> panel_wait_at_start(const PlayFlags& flags,
                                                                      bool service);

/// Reads the rig and makes the plan. `service` is true if a service manager started this process:
/// flags that were not given then have defaults for a kiosk. Throws Error(Usage) for invalid flags,
/// Error(Input) for the rig.
[[nodiscard]] PlayPlan make_plan(const PlayFlags& flags, bool service);

/// Returns the number of whole vblanks within the duration, at least one, also for a duration that
/// is over.
[[nodiscard]] uint64_t whole_vblanks(std::chrono::duration<double> duration, frames::Rate refresh);
/// Returns the same for the value of --duration; none without it.
[[nodiscard]] std::optional<uint64_t> vblanks_of(std::optional<double> duration_s,
                                                 frames::Rate refresh);

/// Returns the list to play: that of a file, or a list of one source. Throws Error.
[[nodiscard]] Playlist read_playlist(const SourceSpec& source, const PlayFlags& flags,
                                     const PlayPlan& plan);
/// Returns a function that opens items, with their sound, as the plan's source would be opened.
[[nodiscard]] ItemOpener item_opener(const PlayPlan& plan);

/// Makes the plan as make_plan() does. If the display is a panel, a missing or broken rig does not
/// throw: its test card stays on the connected panel until the rig can be read. None when
/// interrupted. `services` supplies the clock, session and platform; the real ones are used where
/// they are null.
[[nodiscard]] std::optional<PlayPlan> plan_when_rig_is_right(
    const PlayFlags& flags, const ServiceManager& manager,
    const display::KmsOptions& services = {});

}  // namespace lenticule::player
