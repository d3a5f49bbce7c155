// SPDX-License-Identifier: Apache-2.0
// PlaybackOptions states what play() shows of a source, when, and whom it tells about it.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "base/live_value.h"
#include "display/display.h"
#include "frames/frame_source.h"
#include "player/playback/overlay.h"
#include "player/playback/pacing.h"
#include "player/playback/play_statistics.h"
#include "player/step/step_pacing.h"

namespace lenticule::player {

inline constexpr double kLeastVolumeDb = -80.0, kMostVolumeDb = 12.0;  ///< the least is silence

/// A frame of an item and its ideal time, which the cadence moves by less than a vblank.
struct SoundAnchor {
  uint64_t item = 0;          ///< item number that the source gives
  uint64_t number = 0;        ///< number of the frame within the item
  uint64_t round = 0;         ///< times that the item began again
  uint64_t round_frames = 0;  ///< frames of the longest round so far; 0: there was none
  uint64_t due_ns = 0;        ///< display clock; 0: nothing was shown yet
  uint64_t begun_ns = 0;      ///< time at which the item's turn began
  uint64_t cut = 0;           ///< discontinuity number of the source
  uint64_t numerator = 0;     ///< rate at which frames follow, as played
  uint64_t denominator = 0;
  uint64_t held = 1;  ///< 1: paused, or switched off
};

/// SoundClock tells which picture is due when, by the panel's clock. The presenter writes it at
/// every flip, and the sound follows; docs/play/sound.md.
struct SoundClock {
  LiveValue<SoundAnchor> anchor;
  /// Called by the presenter in simulated time, where no other thread can follow it. Null
  /// otherwise.
  std::function<void(display::Nanoseconds now)> advance = nullptr;
};

class PlaybackControl;

/// Number of loops that means "without end".
inline constexpr uint64_t kForever = 0;

enum class Filling {
  OwnThread,    ///< another thread executes FrameCopier::run()
  InPresenter,  ///< the presenter fills between vblanks: for simulated time, which stands still
                ///< meanwhile
};

/// The state passed to PlaybackOptions::reconnect. Used on the thread of play(); no other
/// thread uses the display or the source meanwhile.
struct LostDisplay {
  const PlayReport& report;
  /// Time until the requested vblanks are over; none = no end.
  std::optional<std::chrono::nanoseconds> time_left;
  /// Keeps the source's peers connected; call it about every second.
  std::function<void()> serve_source;
};

enum class ReconnectResult {
  Reconnected,  ///< the display works again with frames of the same size: playing continues
  GivenUp,      ///< the outcome is DisplayLost
  Stopped,      ///< the outcome is Stopped
  TimeOver,     ///< LostDisplay::time_left is over: the outcome is Finished
};

struct PlaybackOptions {
  /// Content rate; none = the source's own rate, else the display's refresh.
  std::optional<frames::Rate> content = std::nullopt;
  LatePolicy late = LatePolicy::Slip;
  uint64_t loops = 1;  ///< or kForever
  uint64_t prime = 1;  ///< frames that must be ready before the first is shown
  /// Vblanks to play, counted from the first flip; none = to the end.
  std::optional<uint64_t> vblanks = std::nullopt;
  /// Timeout for complete priming once the first frame is there.
  std::chrono::nanoseconds prime_timeout = std::chrono::seconds(2);
  /// Timeout for the next frame if none is ready; none = no timeout.
  std::optional<std::chrono::nanoseconds> stall_timeout = std::chrono::seconds(60);
  Filling filling = Filling::OwnThread;
  /// Requests real-time priority for the presenter; continues without it if not permitted.
  bool real_time_priority = false;

  /// May be null. If set, a frame is released only when it is no longer displayed, so that it can
  /// be copied; earlier if the source allows no more frames at once.
  PlaybackControl* control = nullptr;
  /// Keeps the schedule with a group of players; null = the display's clock alone.
  StepPacing* step = nullptr;
  /// Tells the sound which frame is displayed; may be null.
  SoundClock* sound = nullptr;
  /// Returns the boxes to draw over a frame of the source that is not released, until the next
  /// call. Called on the filling thread; may be null.
  std::function<std::span<const OverlayBox>(const frames::AcquiredFrame& frame)> overlays = nullptr;
  /// Records the turns of the items; may be null.
  TurnLog* turns = nullptr;
  /// Called on the thread of play() when a turn has begun or ended, except the last end.
  std::function<void()> on_turn = nullptr;

  /// Readable = stop; -1 = never.
  int stop_fd = -1;
  /// Called about once a second on the thread of play(); an exception from it ends the playback and
  /// leaves play().
  std::function<void(const PlayReport&)> on_report = nullptr;
  /// Reconnects a lost display. The source's newest frame is then shown again, if the
  /// source lends two frames, and the sequence continues from there. Null = a lost display ends the
  /// playback.
  std::function<ReconnectResult(const LostDisplay&)> reconnect = nullptr;
  /// Reference time of PlayReport::first_frame_ms, and the source's name in the report.
  std::chrono::steady_clock::time_point started = std::chrono::steady_clock::now();
  std::string source_name = {};
};

}  // namespace lenticule::player
