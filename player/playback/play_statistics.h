// SPDX-License-Identifier: Apache-2.0
// LiveStatistics holds the counters of a running playback, PlayReport the report made of them.
// docs/play/player.md explains each figure.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <cstdint>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "base/live_value.h"
#include "base/unique_fd.h"
#include "display/clock.h"
#include "frames/frame.h"
#include "frames/frame_source.h"
#include "frames/rational.h"
#include "player/playback/pacing.h"

namespace lenticule::player {

struct LatencySummary {
  uint64_t count = 0;
  double p50_us = 0;
  double p99_us = 0;
  double max_us = 0;
};

[[nodiscard]] nlohmann::ordered_json latency_json(const LatencySummary& latency);

/// LatencyHistogram computes percentiles of durations in constant memory: one writer that never
/// waits, any number of readers.
/// Uses sixteen bins per power of two, so that a percentile is at most 6 % too large; the maximum
/// is exact.
class LatencyHistogram {
 public:
  /// Records a duration; negative ones count as 0. Thread safety: the writer's thread.
  void record(std::chrono::nanoseconds duration) noexcept {
    const auto value = static_cast<uint64_t>(std::max<int64_t>(duration.count(), 0));
    auto& bin = bins_[bin_of(value)];
    bin.store(bin.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
    if (value > max_.load(std::memory_order_relaxed)) max_.store(value, std::memory_order_relaxed);
  }
  /// Thread safety: any thread.
  [[nodiscard]] LatencySummary summary() const noexcept {
    std::array<uint64_t, kBins> bins;
    uint64_t total = 0;
    for (size_t i = 0; i < kBins; ++i) total += bins[i] = bins_[i].load(std::memory_order_relaxed);
    if (total == 0) return {};

    const uint64_t max = max_.load(std::memory_order_relaxed);
    const auto percentile_us = [&](uint64_t percent) {
      const uint64_t rank = (total * percent + 99) / 100;
      uint64_t seen = 0;
      size_t bin = 0;
      while (bin + 1 < kBins && (seen += bins[bin]) < rank) ++bin;
      return static_cast<double>(std::min(upper_bound_of(bin), max)) / kNanosecondsPerMicrosecond;
    };
    return {.count = total,
            .p50_us = percentile_us(50),
            .p99_us = percentile_us(99),
            .max_us = static_cast<double>(max) / kNanosecondsPerMicrosecond};
  }

 private:
  static constexpr double kNanosecondsPerMicrosecond = 1000.0;
  static constexpr int kBinBits = 4;
  static constexpr int kOctaves = 44;  // up to five hours
  static constexpr size_t kBins = size_t{kOctaves} << kBinBits;

  [[nodiscard]] static size_t bin_of(uint64_t value) noexcept {
    constexpr uint64_t kSubBins = uint64_t{1} << kBinBits;
    if (value < kSubBins) return static_cast<size_t>(value);
    const int shift = static_cast<int>(std::bit_width(value)) - 1 - kBinBits;
    const uint64_t bin = (static_cast<uint64_t>(shift) << kBinBits) + (value >> shift);
    return static_cast<size_t>(std::min<uint64_t>(bin, kBins - 1));
  }
  [[nodiscard]] static uint64_t upper_bound_of(size_t bin) noexcept {
    constexpr uint64_t kSubBins = uint64_t{1} << kBinBits;
    if (bin < kSubBins) return bin;
    const auto shift = (bin >> kBinBits) - 1;
    return (((bin & (kSubBins - 1)) + kSubBins + 1) << shift) - 1;
  }

  std::array<std::atomic<uint64_t>, kBins> bins_{};
  std::atomic<uint64_t> max_{0};
};

/// Counter is written by one thread and read by any; updates of different counters are not ordered.
class Counter {
 public:
  void add(uint64_t amount = 1) noexcept { set(get() + amount); }
  void set(uint64_t value) noexcept { value_.store(value, std::memory_order_relaxed); }
  [[nodiscard]] uint64_t get() const noexcept { return value_.load(std::memory_order_relaxed); }

 private:
  std::atomic<uint64_t> value_{0};
};

/// Identifies the displayed frame.
struct DisplayedPlace {
  uint64_t frames = 0;  ///< frames shown so far; 0 = none yet
  uint64_t index = 0;   ///< index in the playback
  uint64_t item = 0;    ///< item number that the source gives
  uint64_t number = 0;  ///< frame number within the item
};

/// The last displayed frame of an item that was left.
struct LeftItem {
  bool still_displayed = false;          ///< another frame of the item may follow
  std::optional<DisplayedPlace> last{};  ///< none: no frame of the item was displayed
};

// Counters of the two threads: Value is Counter during playback and uint64_t in a report. A new
// counter is a field and a line of the table below the struct; the report and its JSON follow.

template <class Value>
struct PresenterCounts {
  Value late_submits{};     ///< submissions within the margin before their vblank, even if on time
  Value flip_timeouts{};    ///< flips without an event
  Value vblank_timeouts{};  ///< requested vblanks without an event
  Value busy{};             ///< submissions refused because a flip was pending
  Value stray_events{};     ///< events of flips that were not awaited
  Value display_returns{};  ///< times the display was lost and came back
  Value frames_lost{};      ///< frames lost with the display before they were visible
  Value frames_shown_again{};  ///< frames displayed when the display was lost and shown again
  Value frames_cut{};          ///< filled frames left out because of a jump
  Value frames_superseded{};   ///< filled live frames left out because a newer one was filled
};
template <class Value>
inline constexpr std::pair<const char*, Value PresenterCounts<Value>::*> kPresenterCounters[] = {
    {"late_submits", &PresenterCounts<Value>::late_submits},
    {"flip_timeouts", &PresenterCounts<Value>::flip_timeouts},
    {"vblank_timeouts", &PresenterCounts<Value>::vblank_timeouts},
    {"busy", &PresenterCounts<Value>::busy},
    {"stray_events", &PresenterCounts<Value>::stray_events},
    {"display_returns", &PresenterCounts<Value>::display_returns},
    {"frames_lost", &PresenterCounts<Value>::frames_lost},
    {"frames_shown_again", &PresenterCounts<Value>::frames_shown_again},
    {"frames_cut", &PresenterCounts<Value>::frames_cut},
    {"frames_superseded", &PresenterCounts<Value>::frames_superseded},
};
static_assert(std::size(kPresenterCounters<uint64_t>) * sizeof(uint64_t) ==
                  sizeof(PresenterCounts<uint64_t>),
              "each field has a line");

template <class Value>
struct FrameCopierCounts {
  Value loops{};     ///< times the sequence was complete
  Value filled{};    ///< frames copied into scan-out memory
  Value released{};  ///< frames returned uncopied because they would have been too late
  Value overlaid{};  ///< frames copied with overlays
};
template <class Value>
inline constexpr std::pair<const char*, Value FrameCopierCounts<Value>::*> kFrameCopierCounters[] =
    {
        {"loops", &FrameCopierCounts<Value>::loops},
        {"frames_copied", &FrameCopierCounts<Value>::filled},
        {"frames_released", &FrameCopierCounts<Value>::released},
        {"frames_with_overlays", &FrameCopierCounts<Value>::overlaid},
};
static_assert(std::size(kFrameCopierCounters<uint64_t>) * sizeof(uint64_t) ==
                  sizeof(FrameCopierCounts<uint64_t>),
              "each field has a line");

struct PresenterStatistics : PresenterCounts<Counter> {
  LiveValue<PaceCounts> pace;
  LiveValue<DisplayedPlace> displayed;
  LiveValue<DisplayedPlace> left;  ///< last displayed frame of the item before the displayed one
  Counter off;                     ///< 1 while the output is switched off
  Counter turn_ns;     ///< std::chrono::steady_clock at the last turn of its loop; 0 = not running
  Counter starved_ns;  ///< time for which a frame that is due has not been ready
  Counter silent_ns;   ///< time for which the display has reported none of the awaited events
  Counter real_time;   ///< 1 if the presenter has a real-time priority
  Counter first_flip_ns;  ///< std::chrono::steady_clock
  Counter content_numerator;
  Counter content_denominator;
  Counter first_sequence;
  Counter first_vblank_ns;  ///< display clock
  Counter last_sequence;
  Counter last_vblank_ns;
  LatencyHistogram capture_to_submit;  ///< age of live frames
  LatencyHistogram submit_to_flip;
  LatencyHistogram wake;  ///< time from the vblank until the presenter runs
};

struct FrameCopierStatistics : FrameCopierCounts<Counter> {
  Counter turn_ns;           ///< as that of the presenter
  Counter waits_for_others;  ///< 1 if FrameSource::waits_for_others() when no frame was ready
  Counter ready_sum;
  Counter ready_samples;
  Counter ready_min;
  LatencyHistogram copy;

  void sample_ready(uint64_t ready) noexcept {
    ready_min.set(ready_samples.get() == 0 ? ready : std::min(ready_min.get(), ready));
    ready_sum.add(ready);
    ready_samples.add();
  }
};

struct LiveStatistics {
  PresenterStatistics presenter;
  FrameCopierStatistics frame_copier;
};

/// Memory of this process in bytes; zeros where /proc is missing.
struct ResidentMemory {
  uint64_t total = 0;      ///< includes pages of program and library files
  uint64_t anonymous = 0;  ///< part allocated by the process itself
  uint64_t shared = 0;     ///< part in shared memory: the ring
  uint64_t peak = 0;
};
[[nodiscard]] ResidentMemory read_resident_memory();

/// Times in seconds for which a stage of the playback has not done what was due.
struct StageDelays {
  double source = 0;
  double frame_copier = 0;
  double presenter = 0;
  double display = 0;
  bool source_waits_for_others = false;
};

/// The figures at one moment.
struct PlayReport : PresenterCounts<uint64_t>, FrameCopierCounts<uint64_t> {
  std::string source;
  std::string display;
  frames::FrameGeometry geometry;
  frames::Rate refresh;
  frames::Rate content_rate;  ///< rate as played
  LatePolicy late = LatePolicy::Slip;
  bool hardware_clock = false;
  bool real_time = false;
  bool off = false;     ///< the output is switched off on request
  uint64_t item = 0;    ///< number of the displayed frame's item
  std::string outcome;  ///< "playing", "finished", "interrupted", ...

  PaceCounts pace;
  StageDelays delays;
  double refresh_measured_hz = 0;  ///< 0 = not yet
  double first_frame_ms = 0;       ///< time from the start of the command; 0 = not yet
  uint64_t ready_min = 0;
  double ready_avg = 0;
  LatencySummary capture_to_submit;
  LatencySummary submit_to_flip;
  LatencySummary wake;
  LatencySummary copy;
  ResidentMemory memory;
};

[[nodiscard]] nlohmann::ordered_json to_json(const PlayReport& report);
[[nodiscard]] nlohmann::ordered_json to_json(const frames::FrameDamage& damage);
/// Returns "12 frames damaged, 3 missing, 0 repeated".
[[nodiscard]] std::string damage_text(const frames::FrameDamage& damage);
/// Returns two lines for people.
[[nodiscard]] std::string summary_text(const PlayReport& report);

/// ItemTurn is the time from the flip of an item's first frame to that of the next item's.
struct ItemTurn {
  uint64_t turn = 0;      ///< counts the turns of a playback from 1; 0: none
  uint64_t item = 0;      ///< item number that the source gives
  uint64_t frames = 0;    ///< frames that appeared
  uint64_t rounds = 0;    ///< times that the item began again
  uint64_t missed = 0;    ///< vblanks without the frame that was due, and late frames left out
  uint64_t left_out = 0;  ///< frames left out because they were late or as planned
  uint64_t begun_ns = 0;  ///< display clock
  uint64_t ended_ns = 0;  ///< time of the last flip while the turn goes on
  uint64_t cut = 0;       ///< 1: a jump or the end of the playback ended the turn
  friend bool operator==(const ItemTurn&, const ItemTurn&) = default;
};

/// TurnLog records the turns of the items on the display, for the proof of play. The presenter
/// writes it at flips, without a lock; one other thread takes the turns that have ended.
/// Thread safety: flipped() and finish() on the presenter's thread, the rest on one other thread.
class TurnLog {
 public:
  /// Number of ended turns that are kept until they are taken.
  static constexpr size_t kKept = 64;

  struct Flip {
    uint64_t item = 0;
    uint64_t number = 0;  ///< frame number within the item
    uint64_t cut = 0;     ///< discontinuity number of the source
    display::Nanoseconds time{0};
  };
  /// Records a frame that appeared. `counts` include its flip.
  void flipped(const Flip& flip, const PaceCounts& counts) noexcept {
    const auto time_ns = static_cast<uint64_t>(flip.time.count());
    const bool begins = turn_.turn == 0 || flip.item != turn_.item;
    if (begins) {
      end(time_ns, counts, flip.cut != cut_);
      turn_ = {.turn = ++turns_, .item = flip.item, .begun_ns = time_ns};
      at_begin_ = counts;
    } else if (flip.number < last_number_) {
      ++turn_.rounds;
    }
    cut_ = flip.cut;
    last_number_ = flip.number;
    ++turn_.frames;
    turn_.ended_ns = time_ns;
    count(turn_, counts);
    running_.publish(turn_);
    if (begins) changed_.signal();
  }
  /// Ends the running turn: the playback is over.
  void finish(display::Nanoseconds time, const PaceCounts& counts) noexcept {
    end(static_cast<uint64_t>(time.count()), counts, true);
    turn_ = {};
    running_.publish(turn_);
    changed_.signal();
  }

  /// Returns a descriptor that is readable when a turn has begun or ended; take() clears it.
  [[nodiscard]] int fd() const noexcept { return changed_.fd(); }
  /// Returns the oldest ended turn that was not taken yet.
  [[nodiscard]] std::optional<ItemTurn> take() noexcept {
    changed_.drain();
    while (true) {
      const uint64_t ended = ended_count_.load(std::memory_order_acquire);
      if (taken_ == ended) return std::nullopt;
      if (ended - taken_ > kKept) {
        lost_ += ended - kKept - taken_;
        taken_ = ended - kKept;
      }
      const ItemTurn turn = ended_[taken_ % kKept].read();
      ++taken_;
      if (turn.turn == taken_) return turn;
      ++lost_;  // overwritten meanwhile
    }
  }
  /// Returns the turn that goes on; its number is 0 if there is none, or if turns that ended before
  /// were not taken yet.
  [[nodiscard]] ItemTurn running() const noexcept {
    const ItemTurn turn = running_.read();
    return turn.turn == taken_ + 1 ? turn : ItemTurn{};
  }
  /// Returns the number of turns that ended and were overwritten before they were taken.
  [[nodiscard]] uint64_t lost() const noexcept { return lost_; }

 private:
  static uint64_t missed_of(const PaceCounts& counts) noexcept {
    return counts.missed + counts.repeated_underrun + counts.dropped;
  }
  static uint64_t left_out_of(const PaceCounts& counts) noexcept {
    return counts.dropped + counts.skipped_planned;
  }
  void end(uint64_t time_ns, const PaceCounts& counts, bool cut) noexcept {
    if (turn_.turn == 0) return;
    count(turn_, counts);
    turn_.ended_ns = time_ns;
    turn_.cut = cut ? 1 : 0;
    const uint64_t ended = ended_count_.load(std::memory_order_relaxed);
    ended_[ended % kKept].publish(turn_);
    ended_count_.store(ended + 1, std::memory_order_release);
  }
  void count(ItemTurn& turn, const PaceCounts& counts) const noexcept {
    turn.missed = missed_of(counts) - missed_of(at_begin_);
    turn.left_out = left_out_of(counts) - left_out_of(at_begin_);
  }

  // The presenter's members.
  ItemTurn turn_;
  PaceCounts at_begin_;
  uint64_t turns_ = 0;
  uint64_t cut_ = 0;
  uint64_t last_number_ = 0;

  LiveValue<ItemTurn> running_;
  std::array<LiveValue<ItemTurn>, kKept> ended_;
  std::atomic<uint64_t> ended_count_{0};
  WakeFd changed_;

  // The reader's members.
  uint64_t taken_ = 0;
  uint64_t lost_ = 0;
};

}  // namespace lenticule::player
