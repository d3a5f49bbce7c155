// SPDX-License-Identifier: Apache-2.0
// A playlist: what is played one after the other, how often, and at what times of the week.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/file_mark.h"
#include "frames/rational.h"
#include "player/playback/filler.h"
#include "player/sources/frame_range.h"

namespace lenticule::player {

/// A moment of the week, by the clock on the wall.
struct LocalTime {
  int weekday = 0;  ///< 0 = Monday
  int minute = 0;   ///< since midnight, 0 ... 1439
};
[[nodiscard]] LocalTime local_time_now();

/// When an item may begin. A span that ends before it begins goes over midnight and belongs to the
/// day on which it began.
struct Schedule {
  uint8_t days = 0x7f;  ///< bit 0 = Monday
  int from_minute = 0;
  int to_minute = 24 * 60;  ///< exclusive

  [[nodiscard]] bool permits(LocalTime time) const;
  friend bool operator==(const Schedule&, const Schedule&) = default;
};

struct PlaylistItem {
  std::string source{};                ///< as `lenticule play` takes it, apart from lists
  uint64_t loops = 1;                  ///< or kForever; not with a duration
  std::optional<double> duration_s{};  ///< of content time
  /// Of a still picture that says neither how often nor how long; none = one frame.
  std::optional<double> still_s{};
  std::optional<frames::Rate> rate{};
  std::optional<FrameRange> frames{};
  std::optional<Schedule> schedule{};
  /// Begins when as much is ready as its pool holds, and not with the frame that is due.
  bool waits_until_primed = false;
  double wait_s = 10.0;  ///< without a frame, after which it is skipped

  friend bool operator==(const PlaylistItem&, const PlaylistItem&) = default;
  [[nodiscard]] bool permitted(LocalTime time) const {
    return !schedule || schedule->permits(time);
  }
};

struct Playlist {
  std::string name;  ///< for people: the file, or the only source
  std::vector<PlaylistItem> items;
  std::optional<PlaylistItem> standby;  ///< for times that no item is for
  uint64_t rounds = 1;                  ///< or kForever
  std::optional<FileMark> file{};       ///< as it was when it was read; none if it is no file's
};

inline constexpr size_t kMaxPlaylistBytes = size_t{1} << 20;
inline constexpr size_t kMaxPlaylistItems = 1000;
inline constexpr double kStillSeconds = 10.0;

/// "name.toml": what `play` and `load` take for a list.
[[nodiscard]] bool is_playlist_file(std::string_view source);

/// docs/control.md has the keys. Sources that are files are relative to `folder`. Throws
/// Error(Input) that begins with "name:LINE: ".
[[nodiscard]] Playlist parse_playlist(std::string_view toml, const std::string& name,
                                      const std::filesystem::path& folder);
/// Throws Error(Input), also for a file that cannot be read.
[[nodiscard]] Playlist load_playlist(const std::filesystem::path& file);
/// A list of one.
[[nodiscard]] Playlist playlist_of(const std::string& source, uint64_t rounds);

struct NextItem {
  enum class Kind {
    Item,
    Standby,
    None,  ///< nothing is for this time; one may be later
    End,
  };
  Kind kind = Kind::End;
  size_t index = 0;
  uint64_t rounds_done = 0;
};
/// What follows item `after` (none: the beginning) in the given round. Items whose time it is not
/// are passed over. Standby only if none of a whole round can be played.
[[nodiscard]] NextItem next_item(const Playlist& list, std::optional<size_t> after,
                                 uint64_t rounds_done, LocalTime now);

}  // namespace lenticule::player
