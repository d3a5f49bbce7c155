// SPDX-License-Identifier: Apache-2.0
// Playlist holds the items to play one after the other, how often, and at which times of the week.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "frames/rational.h"
#include "player/playback/playback_options.h"
#include "player/sources/source_spec.h"

namespace lenticule::player {

/// PlayState is in one word what a player does, with the reason why it shows nothing new.
struct PlayState {
  std::string word = "playing";
  std::string reason{};

  [[nodiscard]] bool plays() const { return word == "playing"; }
  friend bool operator==(const PlayState&, const PlayState&) = default;
};

inline const PlayState kStarting{"starting", "no frame has come yet"};
inline const PlayState kNoRenderer{"waiting", "no renderer has sent a frame yet"};

/// A moment in local time.
struct LocalTime {
  int day = 0;     ///< days since 29 December 1969, a Monday
  int minute = 0;  ///< minutes since midnight, 0 ... 1439

  [[nodiscard]] int weekday() const { return (day % 7 + 7) % 7; }  ///< 0 = Monday
};
[[nodiscard]] LocalTime local_time_now();
/// Returns the day as LocalTime counts it.
[[nodiscard]] int day_of(std::chrono::year_month_day date);
[[nodiscard]] std::chrono::year_month_day date_of(int day);

/// Days from `first` to `last`, both included: of one year, or of every year if both have year 0.
struct DateSpan {
  std::chrono::year_month_day first;
  std::chrono::year_month_day last;

  [[nodiscard]] bool contains(int day) const;
  friend bool operator==(const DateSpan&, const DateSpan&) = default;
};
/// Parses "2026-12-24", "2026-12-24..2027-01-06", "12-24" or "12-24..01-06".
[[nodiscard]] std::optional<DateSpan> parse_dates(std::string_view text);
[[nodiscard]] std::string to_string(const DateSpan& dates);

/// The times at which an item may begin. A span whose end is before its start passes midnight and
/// belongs to the day on which it began.
struct Schedule {
  uint8_t days = 0x7f;  ///< bit 0 = Monday
  int from_minute = 0;
  int to_minute = 24 * 60;         ///< exclusive
  std::vector<DateSpan> dates{};   ///< empty: every date
  std::vector<DateSpan> except{};  ///< dates on which nothing begins

  [[nodiscard]] bool permits(LocalTime time) const;
  /// Returns the number of minutes from `now` until the next begin of a span; none if there is none
  /// within ten years.
  [[nodiscard]] std::optional<int> minutes_until_begin(LocalTime now) const;
  friend bool operator==(const Schedule&, const Schedule&) = default;
};

/// TransitionKind is how an item follows the one before it: at once, through black, or by a
/// cross-fade.
enum class TransitionKind { Cut, Fade, Cross };
inline constexpr std::array<std::string_view, 3> kTransitionNames = {"cut", "fade", "cross"};

/// SoundBed is the sound that goes on under all items of a list.
struct SoundBed {
  std::string file{};  ///< empty: none
  double volume_db = 0.0;

  friend bool operator==(const SoundBed&, const SoundBed&) = default;
};

struct PlaylistItem {
  /// Not a list; a folder only until FolderLists::with_files().
  SourceSpec source{};
  uint64_t loops = 1;                  ///< or kForever; not together with a duration
  std::optional<double> duration_s{};  ///< duration in content time
  /// Duration of a still picture instead of its loops; none = one frame for each loop.
  std::optional<double> still_s{};
  std::optional<frames::Rate> rate{};
  std::optional<FrameRange> frames{};
  std::optional<Schedule> schedule{};
  /// Starts the item only when its pool is full, instead of with the first due frame.
  bool waits_until_primed = false;
  double wait_s = 10.0;  ///< seconds without a frame after which the item is skipped
  std::optional<TransitionKind> transition{};  ///< none: that of the list
  std::optional<double> transition_s{};
  uint64_t weight = 1;                  ///< plays of the item, relative to others of its list
  std::string fit{};                    ///< as --fit; empty: that of the command
  std::string sound{};                  ///< file of the item's sound, "none", or empty: as found
  double volume_db = 0.0;               ///< volume of its sound
  SoundBed bed{};                       ///< the sound bed of its list
  std::vector<OverlaySpec> overlays{};  ///< those of the list first
  size_t overlays_of_list = 0;
  PlayState shown{};  ///< state that a test card shows; unused by other items

  friend bool operator==(const PlaylistItem&, const PlaylistItem&) = default;
  [[nodiscard]] bool permitted(LocalTime time) const {
    return !schedule || schedule->permits(time);
  }
};

/// An item of a list in one of its rounds, which are counted from 0.
struct ListPlace {
  size_t index = 0;
  int64_t round = 0;

  friend bool operator==(const ListPlace&, const ListPlace&) = default;
};

struct Playlist {
  std::string name;  ///< name for people: the file's name, or the only source
  std::vector<PlaylistItem> items;
  std::optional<PlaylistItem> standby;  ///< played when no item is scheduled or can be played
  uint64_t rounds = 1;                  ///< or kForever
  std::optional<uint64_t> shuffle{};  ///< plays each round in another order, which this seed gives
  TransitionKind transition = TransitionKind::Cut;  ///< default of the items
  double transition_s = 0.5;
  SoundBed bed{};  ///< its items have copies of the bed and of the overlays
  std::vector<OverlaySpec> overlays{};
  /// The file's state when it was read; none if the list is not from a file.
  std::optional<FileMark> file{};
  /// Shows black while no item can be played, because its files may come later.
  bool awaits_files = false;

  /// Returns true for a list of one item that ends with it.
  [[nodiscard]] bool is_single() const { return items.size() == 1 && !standby && !awaits_files; }
  [[nodiscard]] TransitionKind transition_to(const PlaylistItem& item) const {
    return item.transition.value_or(transition);
  }
  /// Returns true if the list has this source at this place.
  [[nodiscard]] bool has(std::optional<size_t> index, const SourceSpec& source) const {
    return index && *index < items.size() && items[*index].source == source;
  }
  /// Returns true if an item follows another one otherwise than by a cut.
  [[nodiscard]] bool has_transitions() const;
  [[nodiscard]] size_t items_scheduled(LocalTime now) const;
  /// Returns true if the item's weight gives it a place in the round. The heaviest items are in
  /// each round; the places of the others are spread evenly over the rounds.
  [[nodiscard]] bool in_round(size_t index, int64_t round) const;
  /// Returns the indices of all items as they are played in the round. With a shuffle, no item is
  /// last in one round and first in the next, if there are more than two.
  [[nodiscard]] std::vector<size_t> order(int64_t round) const;
  /// Returns the place to which `next` (step 1) or `previous` (-1) jumps. Before the first item is
  /// the round before, which for round 0 is -1. After the last one the round begins again, because
  /// a jump completes none; only a shuffle that never ends goes on with its next round.
  [[nodiscard]] ListPlace beside(ListPlace from, int step) const;
};

inline constexpr std::array<std::string_view, 7> kWeekdays = {"mon", "tue", "wed", "thu",
                                                              "fri", "sat", "sun"};
inline constexpr size_t kMaxPlaylistBytes = size_t{1} << 20;
inline constexpr size_t kMaxPlaylistItems = 1000;
inline constexpr uint64_t kMaxWeight = 100;
inline constexpr double kStillSeconds = 10.0;
inline constexpr double kUntilEnded = 1e9;  ///< seconds, longer than any panel lasts

/// Returns for how long a still picture of a list stays: the duration in its sidecar, or
/// kStillSeconds.
[[nodiscard]] double still_seconds(const SourceSpec& source);

/// Parses a playlist: M3U or JSON if its name says so, otherwise TOML; docs/play/control.md lists
/// the keys. Files are relative to `folder`. Throws Error(Input) that begins with "name:LINE: ", or
/// "name: entry N: " for JSON.
[[nodiscard]] Playlist parse_playlist(std::string_view text, const std::string& name,
                                      const std::filesystem::path& folder);
/// Reads and parses a file. Throws Error(Input), also for a file that cannot be read.
[[nodiscard]] Playlist load_playlist(const std::filesystem::path& file);
/// Returns a list of one item.
[[nodiscard]] Playlist playlist_of(const SourceSpec& source, uint64_t rounds);

struct NextItem {
  enum class Kind {
    Item,
    None,  ///< no item is scheduled now; one may be later
    End,
  };
  Kind kind = Kind::End;
  size_t index = 0;
  int64_t rounds_done = 0;
};
/// Returns the item after `after` (none: the first) in the given round. Items that are not
/// scheduled now are skipped. Returns None only if no item of the list is scheduled.
[[nodiscard]] NextItem next_item(const Playlist& list, std::optional<size_t> after,
                                 int64_t rounds_done, LocalTime now);
/// Returns why no item of the list can begin now: "no item is scheduled before Mon 09:00". Empty if
/// one can.
[[nodiscard]] std::string reason_to_wait(const Playlist& list, LocalTime now);

}  // namespace lenticule::player
