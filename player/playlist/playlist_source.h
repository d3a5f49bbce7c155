// SPDX-License-Identifier: Apache-2.0
// PlaylistSource presents a playlist as one source of frames: it opens the next item ahead of time,
// skips items that cannot be played, and can jump while it plays.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/unique_fd.h"
#include "base/wake_fd.h"
#include "frames/frame_source.h"
#include "player/playlist/playlist.h"
#include "player/sources/source_open.h"

namespace lenticule::player {

struct PlaylistEvent {
  enum class Kind {
    ItemStarted,  ///< its first frame was taken; the panel shows it a few frames later
    Seam,         ///< loop point: the item begins again without a gap
    ItemSkipped,  ///< the item cannot be played, or not any further
    Replaced,     ///< the list, or the item's file, was replaced and is played from now on
    Kept,         ///< a replacement cannot be played: the old content continues
    ItemDamaged,  ///< the item was played, but some of its frames were damaged, missing or repeated
  };
  Kind kind = Kind::ItemStarted;
  std::string source;
  std::string detail;  ///< reason for ItemSkipped or Kept
};

/// Returns the state of an item's files; two results are equal as long as no file was replaced.
/// Thread safety: any thread.
using ItemLook = std::function<std::vector<FileMark>(const PlaylistItem& item)>;
/// Reads a list again. Throws Error. Thread safety: any thread; may take long.
using ListReader = std::function<Playlist(const std::string& name)>;

/// Opens an item from its frame `first_frame` on, as open_source() does. Thread safety: any thread;
/// may take long.
using ItemOpener = std::function<OpenedSource(const PlaylistItem& item, uint64_t first_frame)>;

struct PlaylistSourceOptions {
  frames::FrameGeometry panel = {};
  ItemOpener open;
  /// The rate at which all items are played, overriding their own.
  std::optional<frames::Rate> rate = std::nullopt;
  std::function<LocalTime()> local_time = local_time_now;
  /// Called on the filling or the opening thread; must not call back into the source.
  std::function<void(const PlaylistEvent&)> on_event = nullptr;
  /// These two detect replaced files within two or three seconds: a list takes effect at once, an
  /// item at its next loop point. Null = replacements are not detected.
  ItemLook look_at = nullptr;
  ListReader read_list = nullptr;
};

/// The target of a jump.
struct Jump {
  std::shared_ptr<const Playlist> list = nullptr;  ///< null: the list that is playing
  /// Null: the item that is playing; -1 or 1 with `relative`.
  std::optional<int64_t> item = std::nullopt;
  bool relative = false;
  uint64_t frame = 0;
};
/// Called with null when the first frame of the new place has been taken, otherwise with the reason
/// why the old item continues.
using JumpDone = std::function<void(const Error* error)>;

/// A snapshot of the playlist's state.
struct PlaylistStatus {
  std::string list;
  std::string source;  ///< source that frames are taken from; empty if none
  std::optional<size_t> item{};
  size_t items = 0;
  std::optional<uint64_t> frames{};  ///< frames in one round of the item, if known
  uint64_t rounds_done = 0;
  uint64_t started = 0;
  uint64_t seams = 0;
  uint64_t skipped = 0;
  std::string last_trouble{};
  frames::FrameDamage damage{};  ///< total over all items so far
  /// The damaged items, by source.
  std::map<std::string, frames::FrameDamage> damaged_items{};
  bool opening = false;  ///< the target of a jump is being opened
};

/// Thread safety: FrameSource's functions on one thread, the others on any. All frames have the
/// panel's size; an item of another size counts as broken. The source never fails: if no item can
/// be played, it reports that no frame is due.
class PlaylistSource final : public frames::FrameSource {
 public:
  /// Throws Error(Failed) if no descriptor is left. Opens no item yet.
  PlaylistSource(std::shared_ptr<const Playlist> list, PlaylistSourceOptions options);
  ~PlaylistSource() override;
  PlaylistSource(const PlaylistSource&) = delete;
  PlaylistSource& operator=(const PlaylistSource&) = delete;

  /// Opens the first item on the calling thread, before anything is pulled, so that a list of one
  /// unplayable item fails at once. If no item of the list opens, throws the last item's error.
  void open_first();
  /// Sets the rate of items without one; call it before anything is pulled.
  void set_display_rate(frames::Rate rate) { display_rate_ = rate; }

  /// Starts a jump. Only one is pending at a time: a new jump replaces a pending one, which then
  /// fails.
  void jump(Jump jump, JumpDone done);
  /// Sets the loops of the list, or of its only item; kForever is allowed. Takes effect at the next
  /// loop point.
  void set_loops(uint64_t loops);
  /// Prevents the list from ending while `held` is true: it is paused and may jump.
  void hold(bool held);
  /// Checks the list and item for replaced files at once, and reads the list even if its file is
  /// the same.
  void look_again();
  [[nodiscard]] PlaylistStatus status() const;
  /// Returns the source that a frame's `item` came from; empty if it is no longer remembered.
  [[nodiscard]] std::string source_of(uint32_t play) const;
  /// Returns the item's place in the list, if it is remembered and in the list.
  [[nodiscard]] std::optional<size_t> place_of(uint32_t play) const;

  [[nodiscard]] frames::FrameGeometry geometry() const override { return options_.panel; }
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return rate_; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return std::nullopt; }
  [[nodiscard]] frames::PullStatus pull(frames::LentFrame& out) override;
  void release(uint64_t token) override;
  [[nodiscard]] int max_lent() const override;
  [[nodiscard]] uint64_t ready_count() const override;
  [[nodiscard]] bool saturated() const override;
  [[nodiscard]] bool rewind() override { return false; }
  [[nodiscard]] int wake_fd() const override { return poll_.get(); }
  void service() override;
  [[nodiscard]] std::string failure() const override { return {}; }
  [[nodiscard]] bool nothing_owed() const override { return idle_; }
  [[nodiscard]] uint64_t cut() const override { return cut_; }
  [[nodiscard]] frames::FrameDamage damage() const override;

 private:
  using SteadyTime = std::chrono::steady_clock::time_point;

  /// An open item.
  struct Play {
    std::shared_ptr<const Playlist> list;
    PlaylistItem item;
    std::optional<size_t> index;  ///< none: standby
    uint64_t rounds_done = 0;     ///< rounds of the list when the item was chosen
    uint64_t first_frame = 0;
    std::vector<FileMark> files;  ///< state of the files before the item was opened
    OpenedSource opened;

    uint32_t number = 0;  ///< running number over all items that were started
    uint64_t pulled = 0;
    uint64_t pulled_this_round = 0;
    uint64_t loops_done = 0;
    uint64_t lent = 0;
    frames::FrameDamage damage{};  ///< the part that is already counted in the status
    bool skips_to_first = false;
    bool waits_for_renderer = false;  ///< a ring between two sequences
    SteadyTime waiting_since{};
  };
  struct Lent {
    uint64_t token = 0;
    uint64_t inner = 0;
    Play* play = nullptr;
  };
  struct Wish {
    std::unique_ptr<Play> play;  ///< opened by the worker
    PlaylistItem item;
    std::shared_ptr<const Playlist> list;
    std::optional<size_t> index;
    uint64_t rounds_done = 0;
    uint64_t frame = 0;
    uint64_t serial = 0;
    bool opened = false;
    JumpDone done;
    SteadyTime since{};
  };
  /// The playing item, whose files the opening thread checks.
  struct Followed {
    uint32_t number = 0;  ///< 0: none
    PlaylistItem item{};
    std::vector<FileMark> files{};
    std::vector<FileMark> seen{};  ///< state at the last check
  };
  struct Began {
    uint32_t number = 0;
    std::string source;
    std::optional<size_t> index;
  };

  // Filling thread.
  [[nodiscard]] frames::PullStatus pull_current(frames::LentFrame& out);
  [[nodiscard]] frames::PullStatus nothing_yet();
  void hand_out(Play& play, frames::LentFrame& out);
  [[nodiscard]] bool enters_next();
  [[nodiscard]] bool is_over(const Play& play) const;
  [[nodiscard]] bool goes_round(Play& play);
  [[nodiscard]] bool waited_too_long(Play& play) const;
  void begin(std::unique_ptr<Play> play);
  void leave_current();
  [[nodiscard]] bool takes_replacement(Play& play);
  [[nodiscard]] bool is_outdated() const;
  void count_damage(Play& play);
  void break_current(const std::string& why);
  void throw_away(std::unique_ptr<Play> play);
  void want_next_in_time();
  void try_wish();
  [[nodiscard]] frames::PullStatus first_frame_of(Play& play, frames::LentFrame& out);
  void keep_wish_waiting(std::unique_ptr<Play> play, uint64_t serial);
  void enter_wish(std::unique_ptr<Play> play, uint64_t serial, frames::LentFrame first);
  void fail_wish(std::unique_ptr<Play> play, uint64_t serial, const std::string& why);
  [[nodiscard]] uint64_t loops_of(const Play& play) const;
  [[nodiscard]] bool next_is_there() const;
  [[nodiscard]] bool is_alone(const Play& play) const;
  [[nodiscard]] frames::Rate rate_of(const Play& play) const;
  [[nodiscard]] std::optional<uint64_t> frame_limit(const Play& play) const;
  void watch(const Play& play, bool on);

  // Opening thread.
  void work();
  void open_wish(std::unique_lock<std::mutex>& lock);
  void open_next(std::unique_lock<std::mutex>& lock);
  [[nodiscard]] std::unique_ptr<Play> open_play(const PlaylistItem& item, uint64_t frame) const;
  void note_opened(std::unique_ptr<Play> play, const NextItem& pick);
  [[nodiscard]] bool is_time_to_look() const;
  void look_at_files(std::unique_lock<std::mutex>& lock);
  void look_at_list(std::unique_lock<std::mutex>& lock, bool at_once);
  void look_at_item(std::unique_lock<std::mutex>& lock);
  void take_list(Playlist list);

  // Either thread.
  void count_skipped(const std::string& source, const std::string& why);
  void tell(PlaylistEvent::Kind kind, const std::string& source, const std::string& detail = {});
  void wake_filler() const;

  const PlaylistSourceOptions options_;
  frames::Rate display_rate_{60, 1};
  WakeFd wake_;
  UniqueFd poll_;  ///< readable when wake_ or the current item's descriptor is

  // Filling thread only.
  std::unique_ptr<Play> current_;
  std::vector<std::unique_ptr<Play>> retired_;  ///< items with frames that are still borrowed
  std::vector<Lent> lent_;
  std::optional<frames::LentFrame> in_hand_;  ///< first frame after a jump
  std::optional<frames::Rate> rate_;
  uint64_t next_token_ = 1;
  uint32_t next_number_ = 1;
  uint64_t cut_ = 0;
  bool idle_ = false;
  bool at_end_ = false;
  bool next_asked_ = false;

  /// Guards the members below; items are never opened or decoded while it is locked.
  mutable std::mutex mutex_;
  std::condition_variable work_there_;
  std::shared_ptr<const Playlist> list_;
  std::optional<size_t> position_;  ///< place in the list of the item chosen last
  uint64_t rounds_done_ = 0;
  std::unique_ptr<Play> next_;
  bool next_wanted_ = false;
  bool list_over_ = false;
  bool held_ = false;
  bool ended_ = false;            ///< End was returned, which is final
  bool nothing_for_now_ = false;  ///< no item is scheduled now
  bool on_standby_ = false;
  size_t broken_in_a_row_ = 0;
  SteadyTime retry_at_{};
  std::optional<Wish> wish_;
  uint64_t wish_serial_ = 0;
  std::vector<std::unique_ptr<Play>> trash_;
  Followed followed_;
  std::unique_ptr<Play> replacement_;  ///< replaces the item of followed_ at its next loop point
  std::optional<FileMark> list_seen_;  ///< state at the last check
  bool outdated_ = false;  ///< the new list no longer contains the playing item unchanged
  bool look_now_ = false;
  SteadyTime look_at_{};
  std::deque<Began> began_;
  PlaylistStatus status_;
  bool stopping_ = false;

  std::thread worker_;  // last member: the thread uses everything above
};

}  // namespace lenticule::player
