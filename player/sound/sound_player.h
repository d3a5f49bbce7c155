// SPDX-License-Identifier: Apache-2.0
// SoundPlayer plays the sound of what the player shows: it finds an item's sound, runs a confined
// decoder for it, opens the device, and reports.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "frames/frame_source.h"
#include "player/playback/sound_clock.h"
#include "player/playlist/playlist.h"
#include "player/sound/sound_device.h"
#include "player/sources/video_probe.h"

namespace lenticule::player {

struct SoundOptions {
  /// "auto": that of the panel, "none", "file:OUT.wav", or the name of an ALSA device.
  std::string device = "none";
  std::string track{};  ///< language or index of the stream; empty: the first
  double volume_db = 0.0;
  Nanoseconds delay{0};             ///< by which the panel shows a picture after its vblank
  bool simulated = false;           ///< the presenter advances the sound
  std::filesystem::path program{};  ///< lenticule-video; empty = search for it
  std::function<std::unique_ptr<SoundDevice>()> open{};  ///< replaces the device in tests
};

/// A file with sound, and the stream that is played of it.
struct FoundSound {
  std::string file;
  bool own = false;  ///< the film's own, which ends with its pictures
  SoundStream stream{};
};

/// Returns the sound of an item: of its file, beside its source, or its own; none if it has none.
/// Throws Error(Input) for a named file that has no sound, and for sound that cannot be decoded.
[[nodiscard]] std::optional<FoundSound> find_sound(const PlaylistItem& item,
                                                   const SoundOptions& options);
/// Returns true if a stream's language is the one that is wanted: "de" is also "ger" and "deu".
[[nodiscard]] bool is_language(std::string_view tag, std::string_view wanted);

/// Thread safety: open(), set_volume() and what open() returns on any thread, the rest on one.
class SoundPlayer {
 public:
  virtual ~SoundPlayer() = default;
  /// Opens the device and starts to play. `connector` is that of the panel, or empty. Throws
  /// Error(Device) if a named device cannot be opened.
  virtual void start(const std::string& connector) = 0;
  /// Starts a decoder for the sound of an item that begins with `first_frame`; `rate` is that of a
  /// source that states none. Returns what keeps it, to be called with the number that the item's
  /// frames will have; null for an item without sound. Problems are reported, and leave it silent.
  [[nodiscard]] virtual std::function<void(uint64_t number)> open(
      const PlaylistItem& item, std::optional<frames::Rate> rate, uint64_t first_frame,
      const frames::FrameSource& source) = 0;
  [[nodiscard]] virtual const SoundOptions& options() const = 0;
  /// Returns what the presenter writes.
  [[nodiscard]] virtual SoundClock& clock() = 0;
  virtual void set_volume(double db) = 0;
  /// Replaces decoders that have ended. Call it about once a second.
  virtual void look() = 0;
  [[nodiscard]] virtual nlohmann::ordered_json statistics() const = 0;
};

[[nodiscard]] std::shared_ptr<SoundPlayer> make_sound_player(SoundOptions options);

}  // namespace lenticule::player
