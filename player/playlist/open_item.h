// SPDX-License-Identifier: Apache-2.0
// OpenItem is an item of a playlist with its open source and the progress of its playback.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "base/error.h"
#include "player/playback/play_statistics.h"
#include "player/playlist/playlist.h"
#include "player/playlist/transition.h"
#include "player/sources/open_source.h"

namespace lenticule::player {

/// Thread safety: one thread at a time. The loader opens the item, the frame copier plays it and
/// gives it back to the loader to be closed.
struct OpenItem {
  // Set by the loader.
  std::shared_ptr<const Playlist> list;
  PlaylistItem item;
  std::optional<size_t> index;  ///< none: the list's default, or black
  bool interrupts = false;      ///< an item of an interruption, which is not in the list
  int64_t rounds_done = 0;      ///< rounds of the list when the item was chosen
  uint64_t first_frame = 0;
  uint64_t began_at = 0;        ///< frame at which its turn began: that of a jump
  std::vector<FileMark> files;  ///< state of the files before the item was opened
  OpenedSource opened;
  std::unique_ptr<Transition> transition{};  ///< to this item; null: a cut
  std::unique_ptr<OverlaySet> overlays{};    ///< null: none

  // Changed by the frame copier.
  uint32_t number = 0;  ///< running number over all items that were started
  uint64_t frames_pulled = 0;
  /// Frames of this turn; `frames_pulled` includes those of an earlier one.
  uint64_t handed_out = 0;
  uint64_t pulled_this_round = 0;
  uint64_t loops_done = 0;
  uint64_t last_number = 0;  ///< number of the frame that was pulled last
  bool returns = false;      ///< continues after an interruption
  uint64_t acquired = 0;
  frames::FrameDamage damage{};                    ///< the part that is already reported
  std::optional<frames::AcquiredFrame> picture{};  ///< a still picture during its transition
  double blended_s = 0.0;                          ///< time of that transition so far
  bool skips_to_first = false;
  bool waits_for_renderer = false;  ///< a ring between two sequences
  std::chrono::steady_clock::time_point begun{};
  std::chrono::steady_clock::time_point waiting_since{};

  [[nodiscard]] bool is_still() const { return opened.source->frame_count() == uint64_t{1}; }
  /// Returns the time after which the item ends; none if loops end it.
  [[nodiscard]] std::optional<double> seconds() const {
    return item.still_s && is_still() ? item.still_s : item.duration_s;
  }
  /// Returns true for live pictures whose time is over: their frames need not come at a steady
  /// rate.
  [[nodiscard]] bool live_is_over() const;
  /// Returns true for the item of a list of one, which waits for frames as long as its player does.
  [[nodiscard]] bool is_alone() const { return list->is_single(); }
  /// Returns true for the black that is shown before any item or default can be.
  [[nodiscard]] bool is_placeholder() const { return !index && list->standby != item; }
  [[nodiscard]] bool waited_too_long() const;
  /// Returns the number of frames after which the item ends at this rate; none if loops end it.
  [[nodiscard]] std::optional<uint64_t> frame_limit(frames::Rate rate) const;
};

[[nodiscard]] Error no_such_frame(const PlaylistItem& item, uint64_t frame, uint64_t count);

/// The progress of an item that is played again later.
struct ItemProgress {
  uint32_t number = 0;  ///< running number of the item; 0: none
  uint64_t first_frame = 0;
  uint64_t began_at = 0;
  uint64_t frame = 0;  ///< number of the frame with which the item continues
  uint64_t frames_pulled = 0;
  uint64_t pulled_this_round = 0;
  uint64_t loops_done = 0;
  double blended_s = 0.0;
  std::optional<uint64_t> frame_count{};
  uint64_t given = 0;  ///< frames that the playlist had handed out, over all items
  bool final = false;  ///< `frame` and the counts are those at the last displayed frame
};
[[nodiscard]] ItemProgress progress_of(const OpenItem& item, uint64_t given);
/// Takes the frames back that were handed out and not displayed, and the last displayed one, which
/// is shown again. `left` is final.
[[nodiscard]] ItemProgress progress_at(ItemProgress progress, const LeftItem& left);
/// Lets the item, which was opened at `progress.frame`, continue there.
void continue_item(OpenItem& item, const ItemProgress& progress);

/// Opens an item from its frame `first_frame` on, as open_source() does. Thread safety: any thread;
/// may take long.
using ItemOpener = std::function<OpenedSource(const PlaylistItem& item, uint64_t first_frame)>;

}  // namespace lenticule::player
