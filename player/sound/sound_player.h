// SPDX-License-Identifier: Apache-2.0
// SoundPlayer plays the sound of what the player shows: it finds an item's sound, runs a confined
// decoder for it, opens the device, and reports.
//
// Threads: the presenter writes the SoundClock; the sound thread computes and writes blocks without
// a lock; the player's main thread looks after decoders; items are opened and closed on any thread.
// In simulated time the presenter computes the blocks as well.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "frames/frame_source.h"
#include "player/playlist/playlist.h"
#include "player/playlist/playlist_reporter.h"
#include "player/sound/sound_device.h"
#include "player/sound/sound_mixer.h"
#include "player/sources/video_probe.h"

namespace lenticule::player {

struct SoundOptions {
  /// "auto": that of the panel, "none", "file:OUT.wav", or the name of an ALSA device.
  std::string device = "none";
  std::string track{};  ///< language or index of the stream; empty: the first
  double volume_db = 0.0;
  Nanoseconds delay{0};             ///< time by which the panel shows a picture after its vblank
  bool simulated = false;           ///< the presenter advances the sound
  std::filesystem::path program{};  ///< lenticule-video; empty = search for it
  std::function<std::unique_ptr<SoundDevice>()> open{};  ///< replaces the device in tests
};

/// A file with sound, and the stream that is played of it.
struct FoundSound {
  std::string file;
  SoundStream stream{};
};

/// Returns the sound of an item: of its file, beside its source, or its own; none if it has none.
/// Throws Error(Input) for a named file that has no sound, and for sound that cannot be decoded.
[[nodiscard]] std::optional<FoundSound> find_sound(const PlaylistItem& item,
                                                   const SoundOptions& options);
/// Returns true if a stream's language is the one that is wanted: "de" is also "ger" and "deu".
[[nodiscard]] bool is_language(std::string_view tag, std::string_view wanted);

/// Thread safety: open(), set_volume() and what open() returns on any thread, the rest on one.
/// Lifetime: a shared pointer owns it, and what open() returns shares it.
class SoundPlayer : public std::enable_shared_from_this<SoundPlayer> {
 public:
  explicit SoundPlayer(SoundOptions options);
  ~SoundPlayer();

  /// Opens the device and starts to play. `connector` is that of the panel, or empty. Throws
  /// Error(Device) if a named device cannot be opened.
  void start(const std::string& connector);
  /// Starts a decoder for the sound of an item that begins with `first_frame`; `rate` is that of a
  /// source that states none. Returns what keeps it, to be called with the number that the item's
  /// frames will have and the rounds to play, 0 for no end; null for an item without sound and bed.
  /// Problems are reported, and leave it silent.
  [[nodiscard]] std::function<void(uint64_t number, uint64_t rounds)> open(
      const PlaylistItem& item, std::optional<frames::Rate> rate, uint64_t first_frame,
      const frames::FrameSource& source);
  [[nodiscard]] const SoundOptions& options() const { return options_; }
  /// Returns what the presenter writes.
  [[nodiscard]] SoundClock& clock() { return clock_; }
  void set_volume(double db) { mixer_.volume_db.store(db); }
  /// Replaces decoders that have ended, and ends those of items that are over. Call it about once a
  /// second.
  void look() noexcept;
  [[nodiscard]] nlohmann::ordered_json statistics() const;
  /// Returns what was heard of an item so far; none for an item without sound. On any thread.
  [[nodiscard]] std::optional<SoundAccount> account_of(uint64_t number);

 private:
  struct Item;
  struct Bed {
    SoundBed wanted;
    FoundSound found;
  };
  [[nodiscard]] std::shared_ptr<Item> open_own(const PlaylistItem& item,
                                               std::optional<frames::Rate> rate,
                                               uint64_t first_frame,
                                               const frames::FrameSource& source);
  [[nodiscard]] uint64_t find_bed(const SoundBed& wanted);
  [[nodiscard]] std::unique_ptr<SoundDevice> make_device() const;
  void set_device(std::unique_ptr<SoundDevice> device);
  void complain(const std::string& problem) noexcept;
  void run(const std::stop_token& stop) noexcept;
  bool play_block(Nanoseconds time) noexcept;
  void advance(Nanoseconds time) noexcept;

  const SoundOptions options_;
  SoundClock clock_;
  SoundMixer mixer_{clock_};
  std::string connector_;
  std::unique_ptr<SoundDevice> device_;  ///< used by the sound thread
  std::array<float, kSoundBlock * kSoundChannels> block_{};
  std::atomic<uint64_t> device_underruns_{0};
  std::atomic<bool> waits_{true};  ///< the presenter waits for decoders, in simulated time

  mutable std::mutex mutex_;  ///< guards the members below and the items
  std::vector<Item*> items_;
  std::string device_name_;  ///< empty while there is none
  uint64_t serials_ = 0;
  uint64_t restarts_ = 0, damaged_ = 0;      ///< counts of decoders that have ended
  std::vector<std::unique_ptr<Item>> left_;  ///< items that were closed, and may be heard
  std::vector<Bed> beds_;                    ///< number n at n - 1
  std::unique_ptr<Item> bed_;                ///< the bed that was due last, or the first one
  mutable std::mutex complaints_mutex_;      ///< guards the members below
  std::set<std::string> complaints_;         ///< each is printed once
  std::string problem_;
  std::jthread thread_;
};

}  // namespace lenticule::player
