// SPDX-License-Identifier: Apache-2.0
// What a playback counts while it runs, and the report made of it. docs/player.md says what each
// figure means.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "frames/frame.h"
#include "frames/frame_source.h"
#include "frames/rational.h"
#include "player/playback/latency_histogram.h"
#include "player/playback/pacing.h"

namespace lenticule::player {

/// Written by one thread, read by any; no order between counters is promised.
class Counter {
 public:
  void add(uint64_t amount = 1) noexcept { set(get() + amount); }
  void set(uint64_t value) noexcept { value_.store(value, std::memory_order_relaxed); }
  [[nodiscard]] uint64_t get() const noexcept { return value_.load(std::memory_order_relaxed); }

 private:
  std::atomic<uint64_t> value_{0};
};

/// PaceCounts that a second thread can read.
class LivePaceCounts {
 public:
  void publish(const PaceCounts& counts) noexcept;
  [[nodiscard]] PaceCounts read() const noexcept;

 private:
  static constexpr size_t kFields = sizeof(PaceCounts) / sizeof(uint64_t);
  std::array<Counter, kFields> fields_;
};

/// Which frame is on the glass.
struct GlassPlace {
  uint64_t frames = 0;  ///< shown so far; 0 = nothing is on the glass yet
  uint64_t index = 0;   ///< of the playback
  uint64_t item = 0;    ///< of the source
  uint64_t number = 0;  ///< within the item
};

/// A GlassPlace that any thread can read whole, written by one that never waits.
class LiveGlassPlace {
 public:
  void publish(const GlassPlace& place) noexcept;
  [[nodiscard]] GlassPlace read() const noexcept;

 private:
  static constexpr size_t kFields = sizeof(GlassPlace) / sizeof(uint64_t);
  std::atomic<uint64_t> version_{0};  ///< odd while it is being written
  std::array<std::atomic<uint64_t>, kFields> fields_{};
};

struct PresenterStatistics {
  LivePaceCounts pace;
  LiveGlassPlace glass;
  Counter frames_cut;          ///< filled, and left out because something else was wanted
  Counter late_submits;        ///< within the margin before their vblank, even if they made it
  Counter flip_timeouts;       ///< flips whose event never came
  Counter vblank_timeouts;     ///< vblanks asked for whose event never came
  Counter busy;                ///< submissions refused because a flip was pending
  Counter stray_events;        ///< events of flips that nobody waited for
  Counter display_returns;     ///< times that the display was lost and came back
  Counter frames_lost;         ///< went down with the display, unseen
  Counter frames_shown_again;  ///< those that were on the glass when the display was lost
  Counter real_time;           ///< 1 if the presenter has a real-time priority
  Counter first_flip_ns;       ///< std::chrono::steady_clock
  Counter content_numerator;
  Counter content_denominator;
  Counter first_sequence;
  Counter first_vblank_ns;  ///< display clock
  Counter last_sequence;
  Counter last_vblank_ns;
  LatencyHistogram submit_to_flip;
  LatencyHistogram wake;  ///< from the vblank until the presenter runs
};

struct FillerStatistics {
  Counter filled;    ///< frames copied into scan-out memory
  Counter released;  ///< frames given back uncopied, because they would have been too late
  Counter loops;     ///< times the sequence was complete
  Counter ready_sum;
  Counter ready_samples;
  Counter ready_min;
  LatencyHistogram copy;

  void sample_ready(uint64_t ready) noexcept;
};

struct LiveStatistics {
  PresenterStatistics presenter;
  FillerStatistics filler;
};

/// Of this process, in bytes; zeros where /proc is missing.
struct ResidentMemory {
  uint64_t total = 0;      ///< the rest of it are pages of program and library files
  uint64_t anonymous = 0;  ///< the part that the process took for itself
  uint64_t shared = 0;     ///< the part that is shared memory: the ring
  uint64_t peak = 0;
};
[[nodiscard]] ResidentMemory read_resident_memory();

/// A moment's figures.
struct PlayReport {
  std::string source;
  std::string display;
  frames::FrameGeometry geometry;
  frames::Rate refresh;
  frames::Rate content_rate;  ///< as played
  LatePolicy late = LatePolicy::Slip;
  bool hardware_clock = false;
  bool real_time = false;
  std::string outcome;  ///< "playing", "finished", "interrupted", ...

  PaceCounts pace;
  uint64_t late_submits = 0;
  uint64_t flip_timeouts = 0;
  uint64_t vblank_timeouts = 0;
  uint64_t busy = 0;
  uint64_t stray_events = 0;
  uint64_t display_returns = 0;
  uint64_t frames_lost = 0;
  uint64_t frames_shown_again = 0;
  uint64_t frames_cut = 0;
  uint64_t loops = 0;
  uint64_t filled = 0;
  uint64_t released = 0;
  double refresh_measured_hz = 0;  ///< 0 = not yet
  double first_frame_ms = 0;       ///< from the start of the command; 0 = not yet
  uint64_t ready_min = 0;
  double ready_avg = 0;
  LatencySummary submit_to_flip;
  LatencySummary wake;
  LatencySummary copy;
  ResidentMemory memory;
};

[[nodiscard]] nlohmann::ordered_json to_json(const PlayReport& report);
[[nodiscard]] nlohmann::ordered_json to_json(const frames::FrameDamage& damage);
/// "12 frames damaged, 3 missing, 0 repeated"
[[nodiscard]] std::string damage_text(const frames::FrameDamage& damage);
/// Two lines for people.
[[nodiscard]] std::string summary_text(const PlayReport& report);

}  // namespace lenticule::player
