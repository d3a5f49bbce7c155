// SPDX-License-Identifier: Apache-2.0
// SoundMixer computes what is heard at a time: the sound of the displayed item, at the place of the
// displayed picture.
//
// The panel's clock leads. Each block of samples is computed for the time at which the device will
// play it; the SoundAnchor says which picture, and so which sample, belongs to that time. While
// the sample that comes next anyway is less than 8 ms away from it, the sound follows slowly: it
// is resampled (windowed sinc, 32 taps) by 0.02 % per millisecond, at most 0.5 %, so that 200 ppm
// between the two clocks leave 1 ms. Otherwise, and after a start, a seek, a pause or a change of
// item, it jumps, with fades of 10 ms. A round of a film joins the next one in the ring.
//
// The sound bed of a list has no place in a picture: its samples follow each other as the decoder
// wrote them, by the device's clock. The mixer adds it to the sound of the items. It is heard while
// the displayed item is of its list and has no sound of its own at that time. Otherwise it fades
// out and stops; later it goes on with its next sample.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <span>
#include <thread>
#include <utility>

#include "frames/rational.h"
#include "frames/sound/sound_ring.h"
#include "player/playback/play_statistics.h"
#include "player/playback/playback_options.h"
#include "player/sound/sound_device.h"

namespace lenticule::player {

/// The sound of an item, as one decoder delivers it. Constant except for the ring.
struct ItemSamples {
  frames::SoundRing ring{};
  uint64_t serial = 0;                ///< differs from that of all others
  std::optional<frames::Rate> fps{};  ///< rate of the pictures; none: a still picture
  uint64_t frames = 0;                ///< pictures of a round; 0: the ring may know its length
  uint64_t first_round = 0;           ///< round in which frame 0 of the ring lies
  double first = 0.0;                 ///< samples of that round before frame 0
  uint64_t bed = 0;                   ///< number of the bed of these samples; 0: those of an item
  double volume_db = 0.0;
};

/// SoundSlot is the place of an item's sound. Its owner fills it, the mixer reads it.
struct SoundSlot {
  static constexpr uint64_t kNoItem = ~uint64_t{0};
  std::atomic<uint64_t> item{kNoItem};
  std::atomic<ItemSamples*> samples{nullptr};
  std::atomic<uint64_t> rounds{0};         ///< after which comes silence; 0: without end
  std::atomic<bool> needs_decoder{false};  ///< the ring will never have what is due
};

/// SoundTime is how long an item's sound was heard, and how long it was due and could not be
/// played, in samples. Times of silence by the operator's wish are in neither.
struct SoundTime {
  std::atomic<uint64_t> item{SoundSlot::kNoItem}, heard{0}, silent{0};
};

struct SoundCounts {
  Counter underruns;  ///< times that the decoder was late
  Counter late;       ///< 1 while it is
  Counter jumps;      ///< times that the sound was moved because it was too far away
  Counter offset_us;  ///< smoothed distance between sound and picture
  Counter worst_us;   ///< the largest one, a second or more after a jump
  Counter playing;    ///< 1 while an item's sound is heard
  Counter bed;        ///< a BedState
};
enum BedState : uint64_t { kBedStands, kBedHeard, kBedLate };

/// Thread safety: volume, counts, slots and retire() on any thread, the rest on one.
class SoundMixer {
 public:
  /// Lifetime: the clock must outlive the mixer.
  explicit SoundMixer(const SoundClock& clock) : clock_(clock) {
    using std::numbers::pi;
    for (int phase = 0; phase <= kPhases; ++phase)
      for (int k = 0; k < kTaps; ++k) {
        const double x = k - kBefore - static_cast<double>(phase) / kPhases;
        const double window = 0.5 + 0.5 * std::cos(2.0 * pi * x / (kTaps + 1));
        const double tap = std::abs(x) < 1e-9 ? 1.0 : std::sin(pi * x) / (pi * x) * window;
        filter_[static_cast<size_t>(phase)][static_cast<size_t>(k)] = static_cast<float>(tap);
      }
  }

  /// Fills a block of kSoundBlock frames that is heard from this time on. Takes no lock and
  /// allocates nothing.
  void render(std::span<float> block, Nanoseconds heard) noexcept {
    turn_.fetch_add(1);
    std::ranges::fill(block, 0.0F);
    const SoundAnchor anchor = clock_.anchor.read();
    const Place due = place_at(anchor, heard);
    const bool same =
        due.samples != nullptr && due.samples->serial == serial_ && anchor.cut == cut_;
    if (same) follow(due);
    const bool jumps = same && far_ >= kBlocksFar;
    if (serial_ != 0 && (!same || jumps)) fade_out();
    if (due.samples == nullptr) {
      serial_ = 0;
    } else if (!same || jumps) {
      if (jumps) counts_.jumps.add();
      serial_ = due.samples->serial;
      cut_ = anchor.cut;
      at_ = std::round(due.at);  // whole samples stay what they are while the clocks agree
      speed_ = due.speed;
      error_ = 0.0;
      far_ = 0;
      since_jump_ = 0;
      fade_in_ = at_ + due.samples->first > 0.001 * kSoundRate ? kFade : 0;
    }
    if (serial_ != 0) play(*due.samples, block);
    for (auto out = block.begin(); tail_at_ < tail_.size() && out != block.end();)
      *out++ += tail_[tail_at_++];
    play_bed(anchor, due, heard, block);
    std::ranges::transform(block, block.begin(), sample);
    counts_.playing.set(serial_ != 0 ? 1 : 0);
    if (due.due) count(anchor.item, serial_ != 0 && counts_.late.get() == 0, kSoundBlock);
    turn_.fetch_add(1);
  }
  /// Counts samples that no device plays.
  void miss(Nanoseconds heard, uint64_t samples) noexcept {
    turn_.fetch_add(1);
    const SoundAnchor anchor = clock_.anchor.read();
    if (place_at(anchor, heard).due) count(anchor.item, false, samples);
    turn_.fetch_add(1);
  }
  /// Returns the place of an item's time, which the items that follow get in turn.
  [[nodiscard]] SoundTime& time_of(uint64_t item) noexcept { return times_[item % times_.size()]; }
  /// Returns true if render() would find all samples, or none is due.
  [[nodiscard]] bool is_ready(Nanoseconds heard) noexcept {
    turn_.fetch_add(1);
    const SoundAnchor anchor = clock_.anchor.read();
    const Place due = place_at(anchor, heard);
    ItemSamples* const bed = present_bed();
    const bool ready = (due.samples == nullptr || is_there(due.samples->ring, due.at)) &&
                       (!is_due(bed, anchor, due, heard) || is_there(bed->ring, bed_at_));
    turn_.fetch_add(1);
    return ready;
  }

  [[nodiscard]] std::array<SoundSlot, 16>& slots() noexcept { return slots_; }
  /// Returns the place of a bed's samples.
  [[nodiscard]] SoundSlot& bed_slot() noexcept { return bed_slot_; }
  /// Gives an item the bed of this number; 0: none.
  void set_bed(uint64_t item, uint64_t bed) noexcept {
    beds_[item % beds_.size()].store(item << 32 | bed);
  }
  /// Returns the number of an item's bed; 0: none.
  [[nodiscard]] uint64_t bed_of(uint64_t item) const noexcept {
    const uint64_t laid = beds_[item % beds_.size()].load();
    return laid >> 32 == item ? laid & 0xffffffff : 0;
  }
  /// Takes the samples out of a slot; afterwards the mixer does not use them.
  void retire(SoundSlot& slot) noexcept {
    slot.samples.store(nullptr);
    const uint64_t turn = turn_.load();
    // Sleeps, because a thread of a higher priority that yields would keep the mixer from its turn.
    while (turn % 2 != 0 && turn_.load() == turn)
      std::this_thread::sleep_for(std::chrono::microseconds(50));
  }
  [[nodiscard]] const SoundCounts& counts() const noexcept { return counts_; }
  /// Returns true if a film of this rate is played at it, except for the lock to the panel's.
  [[nodiscard]] static bool follows(const SoundAnchor& anchor, const frames::Rate& fps) noexcept {
    return std::abs(speed_of(anchor) / fps.hertz() - 1.0) <= kMostLocked;
  }

  std::atomic<double> volume_db{0.0};  ///< volume, to which that of the item is added

 private:
  static constexpr int kTaps = 32, kBefore = kTaps / 2 - 1, kPhases = 256;
  static constexpr size_t kFade = kSoundRate / 100;
  static constexpr uint64_t kAhead = 2 * kSoundBlock + kTaps;  ///< needed to play a block
  static constexpr double kFarthest = 0.008 * kSoundRate;      ///< beyond it the sound jumps
  static constexpr int kBlocksFar = 4;                   ///< but not for one wrong time of a device
  static constexpr double kNear = 0.00025 * kSoundRate;  ///< within it nothing is corrected
  static constexpr double kMostCorrection = 0.005, kSecondsToCorrect = 5.0;
  static constexpr double kSmoothing = kSoundBlock / (0.5 * kSoundRate);
  static constexpr double kMostLocked = 0.0055;  ///< to which a rate is locked to the panel's
  static constexpr double kLongestStall = 0.3;   ///< seconds
  static constexpr double kLongestLast = 5.0;    ///< seconds of a bed after the last picture
  static constexpr float kBedFade = kSoundRate / 2.0F;

  /// Place is what is due: a frame of an item's ring, with its fraction, and the speed.
  struct Place {
    ItemSamples* samples = nullptr;
    double at = 0.0;
    double speed = 1.0;  ///< samples of the film per sample that is heard
    bool due = false;    ///< the item has sound at this time
  };
  /// Makes any float a sample, also not-a-number: the decoder is not trusted.
  static float sample(float x) noexcept {
    return x >= -1.0F && x <= 1.0F ? x : x > 1.0F ? 1.0F : x < -1.0F ? -1.0F : 0.0F;
  }

  [[nodiscard]] Place place_at(const SoundAnchor& anchor, Nanoseconds heard) noexcept {
    if (anchor.due_ns == 0 || anchor.held != 0) return {};
    const auto slot = std::ranges::find(slots_, anchor.item,
                                        [](const SoundSlot& one) { return one.item.load(); });
    if (slot == slots_.end()) return {};
    ItemSamples* const samples = slot->samples.load();
    if (samples == nullptr) return {.due = true};
    if (!samples->fps)
      return {.samples = samples,
              .at = seconds_since(anchor.begun_ns, heard) * kSoundRate,
              .due = true};
    if (!follows(anchor, *samples->fps)) return {};
    const double fps = samples->fps->hertz(), speed = speed_of(anchor) / fps;
    const auto round = static_cast<double>(anchor.round - samples->first_round);
    const double length = samples->frames > 0
                              ? static_cast<double>(samples->frames) * kSoundRate / fps
                              : static_cast<double>(samples->ring.round());
    const double frame =
        static_cast<double>(anchor.number) + seconds_since(anchor.due_ns, heard) * fps * speed;
    const double at = round * length + frame * kSoundRate / fps - samples->first;
    const bool never = anchor.round < samples->first_round || (round > 0.0 && length == 0.0) ||
                       (at >= 0.0 && samples->ring.is_gone(static_cast<uint64_t>(at)));
    if (never) slot->needs_decoder.store(true);
    const uint64_t rounds = slot->rounds.load();
    const double left = static_cast<double>(rounds) - static_cast<double>(samples->first_round);
    const bool over = rounds > 0 && length > 0.0 && at + samples->first >= left * length;
    if (over || never || seconds_since(anchor.due_ns, heard) > kLongestStall) return {.due = !over};
    return {.samples = samples, .at = at, .speed = speed, .due = true};
  }
  static double seconds_since(uint64_t ns, Nanoseconds heard) noexcept {
    return static_cast<double>(heard.count() - static_cast<int64_t>(ns)) * 1e-9;
  }
  /// Returns the samples of the bed, or null. Those of another decoder begin.
  [[nodiscard]] ItemSamples* present_bed() noexcept {
    ItemSamples* const bed = bed_slot_.samples.load();
    if (bed != nullptr && std::exchange(bed_serial_, bed->serial) != bed->serial)
      bed_at_ = bed_level_ = 0.0F;
    return bed;
  }
  /// Determines whether the bed should be heard at the time `heard`, when `due` is the item's own.
  [[nodiscard]] bool is_due(const ItemSamples* bed, const SoundAnchor& anchor, const Place& due,
                            Nanoseconds heard) const noexcept {
    return bed != nullptr && anchor.due_ns != 0 && anchor.held == 0 && !due.due &&
           bed_of(anchor.item) == bed->bed &&
           seconds_since(anchor.due_ns, heard) < kLongestLast + 1.0 / speed_of(anchor);
  }
  void play_bed(const SoundAnchor& anchor, const Place& due, Nanoseconds heard,
                std::span<float> block) noexcept {
    ItemSamples* const bed = present_bed();
    if (bed == nullptr) return counts_.bed.set(kBedStands);
    const bool wanted = is_due(bed, anchor, due, heard), there = is_there(bed->ring, bed_at_);
    if (wanted && !there && bed_level_ > 0.0F) counts_.underruns.add();
    const float fade = anchor.held != 0 ? 1.0F * kFade : there ? kBedFade : 1.0F * kSoundBlock;
    const float step = wanted && there ? 1.0F / kBedFade : -1.0F / fade;
    const float gain = gain_of(volume_db.load()) * gain_of(bed->volume_db);
    const float louder = (gain - bed_gain_) / kSoundBlock;
    for (size_t k = 0; k < block.size(); k += kSoundChannels, ++bed_at_) {
      bed_level_ = std::clamp(bed_level_ + step, 0.0F, 1.0F);
      if (bed_level_ == 0.0F) break;
      read(bed->ring, bed_at_, bed_level_ * (bed_gain_ += louder), &block[k]);
    }
    bed_gain_ = gain;
    counts_.bed.set(bed_level_ > 0.0F ? kBedHeard : wanted && !there ? kBedLate : kBedStands);
  }
  void count(uint64_t item, bool heard, uint64_t samples) noexcept {
    SoundTime& time = time_of(item);
    if (time.item.load() == item && volume_db.load() > kLeastVolumeDb)
      (heard ? time.heard : time.silent).fetch_add(samples);
  }
  static double speed_of(const SoundAnchor& anchor) noexcept {
    return static_cast<double>(anchor.numerator) / static_cast<double>(anchor.denominator);
  }
  static float gain_of(double db) noexcept {
    return db <= kLeastVolumeDb ? 0.0F : static_cast<float>(std::pow(10.0, db / 20.0));
  }
  /// Returns true if a block from this frame on is in the ring. Frees what lies before it.
  static bool is_there(frames::SoundRing& ring, double at) noexcept {
    ring.look();
    ring.play_from(static_cast<uint64_t>(std::max(0.0, at - kTaps)));
    return ring.holds(static_cast<uint64_t>(std::max(0.0, at)) + kAhead);
  }
  /// Computes the 10 ms that follow of what was played, while it becomes silent.
  void fade_out() noexcept {
    tail_.fill(0.0F);
    tail_at_ = 0;
    for (const SoundSlot& slot : slots_)
      if (ItemSamples* const samples = slot.samples.load();
          samples != nullptr && samples->serial == serial_)
        play(*samples, tail_);
    for (size_t k = 0; k < tail_.size(); ++k)
      tail_[k] *= 1.0F - static_cast<float>(k / kSoundChannels + 1) / kFade;
  }
  void follow(const Place& due) noexcept {
    const double error = due.at - at_;
    far_ = std::abs(error) > kFarthest ? far_ + 1 : 0;
    error_ += (error - error_) * kSmoothing;
    const double beyond = std::abs(error_) < kNear ? 0.0 : error_;
    speed_ = due.speed * (1.0 + std::clamp(beyond / (kSoundRate * kSecondsToCorrect),
                                           -kMostCorrection, kMostCorrection));
    const auto offset_us = static_cast<uint64_t>(std::abs(error_) * 1e6 / kSoundRate);
    counts_.offset_us.set(offset_us);
    since_jump_ += kSoundBlock;
    if (since_jump_ > kSoundRate) counts_.worst_us.set(std::max(counts_.worst_us.get(), offset_us));
  }
  /// Writes the frames from at_ on, and moves on. Becomes silent before the ring is empty.
  void play(ItemSamples& samples, std::span<float> out) noexcept {
    const bool there = is_there(samples.ring, at_);
    if (!there && counts_.late.get() == 0) counts_.underruns.add();
    counts_.late.set(there ? 0 : 1);
    const float target = there ? gain_of(volume_db.load()) * gain_of(samples.volume_db) : 0.0F;
    if (since_jump_ == 0) gain_ = target;
    const float step = (target - gain_) / static_cast<float>(out.size() / kSoundChannels);
    for (size_t k = 0; k < out.size(); k += kSoundChannels, at_ += speed_) {
      float gain = gain_ += step;
      if (fade_in_ > 0) gain *= 1.0F - static_cast<float>(fade_in_--) / kFade;
      read(samples.ring, at_, gain, &out[k]);
    }
    gain_ = target;
  }
  void read(const frames::SoundRing& ring, double at, float gain, float* out) const noexcept {
    const double whole = std::floor(at);
    const auto add = [&](int64_t frame, float weight) {
      if (frame < 0 || !ring.holds(static_cast<uint64_t>(frame))) return;
      for (size_t c = 0; c < kSoundChannels; ++c)
        out[c] += weight * sample(ring.at(static_cast<uint64_t>(frame))[c]);
    };
    if (at == whole) return add(static_cast<int64_t>(whole), gain);
    const double place = (at - whole) * kPhases;
    const auto phase = static_cast<size_t>(place);
    const auto part = static_cast<float>(place - std::floor(place));
    for (size_t k = 0; k < kTaps; ++k)
      add(static_cast<int64_t>(whole) + static_cast<int64_t>(k) - kBefore,
          gain * (filter_[phase][k] + part * (filter_[phase + 1][k] - filter_[phase][k])));
  }

  const SoundClock& clock_;
  std::array<SoundSlot, 16> slots_;
  std::array<SoundTime, TurnLog::kKept> times_;
  SoundSlot bed_slot_;
  std::array<std::atomic<uint64_t>, TurnLog::kKept> beds_{};  ///< item << 32 | bed
  std::atomic<uint64_t> turn_{0};  ///< odd while the mixer may use samples
  SoundCounts counts_;
  std::array<std::array<float, kTaps>, kPhases + 1> filter_{};

  uint64_t serial_ = 0;  ///< number of the samples that play; 0: none
  uint64_t cut_ = 0;
  double at_ = 0.0;     ///< frame of the ring that is heard next
  double speed_ = 1.0;  ///< with the correction
  double error_ = 0.0;  ///< smoothed distance from what is due, in frames
  int far_ = 0;         ///< number of blocks for which the sound has been too far away
  uint64_t since_jump_ = 0;
  float gain_ = 0.0F;
  size_t fade_in_ = 0;  ///< frames until the sound has its full volume
  std::array<float, kFade * kSoundChannels> tail_{};  ///< samples that fade out, from tail_at_ on
  size_t tail_at_ = kFade * kSoundChannels;

  uint64_t bed_serial_ = 0;
  double bed_at_ = 0.0;     ///< frame of the bed's ring that is heard next
  float bed_level_ = 0.0F;  ///< 0: it stands; 1: it has its volume
  float bed_gain_ = 0.0F;
};

}  // namespace lenticule::player
