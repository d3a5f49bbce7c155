// SPDX-License-Identifier: Apache-2.0
// A playlist as one source of frames: opens what comes next ahead of time, passes over what is
// broken, and can be sent elsewhere while it plays.
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
#include "frames/frame_source.h"
#include "player/playlist/playlist.h"
#include "player/sources/source_open.h"

namespace lenticule::player {

struct PlaylistEvent {
  enum class Kind {
    ItemStarted,  ///< its first frame was taken; the glass has it a few frames later
    Seam,         ///< it begins again, without a gap
    ItemSkipped,  ///< it cannot be played, or not any further
    Replaced,     ///< the list, or the item's file, is another one, and is played from now on
    Kept,         ///< another one is there and cannot be played: the old one goes on
    ItemDamaged,  ///< it was played, but some of its frames did not come as they were made
  };
  Kind kind = Kind::ItemStarted;
  std::string source;
  std::string detail;  ///< why it was skipped, or kept
};

/// Looks at the files of an item; two looks are equal as long as nobody replaced one. Any thread.
using ItemLook = std::function<std::vector<FileMark>(const PlaylistItem& item)>;
/// Reads a list again. Throws Error. Any thread; may take long.
using ListReader = std::function<Playlist(const std::string& name)>;

/// Opens an item from its frame `first_frame` on, as open_source() does. Any thread; may take long.
using ItemOpener = std::function<OpenedSource(const PlaylistItem& item, uint64_t first_frame)>;

struct PlaylistSourceOptions {
  frames::FrameGeometry panel = {};
  ItemOpener open;
  /// That everything is played at, whatever it says.
  std::optional<frames::Rate> rate = std::nullopt;
  std::function<LocalTime()> local_time = local_time_now;
  /// From the filling thread or the opening one; must not call back.
  std::function<void(const PlaylistEvent&)> on_event = nullptr;
  /// By which files that were replaced are noticed, within two or three seconds: a list at once, an
  /// item at its next seam. Null = they are not.
  ItemLook look_at = nullptr;
  ListReader read_list = nullptr;
};

/// Where to go instead.
struct Jump {
  std::shared_ptr<const Playlist> list = nullptr;  ///< null: the one that is playing
  /// Null: the item that is playing; -1 and 1 with `relative`.
  std::optional<int64_t> item = std::nullopt;
  bool relative = false;
  uint64_t frame = 0;
};
/// Null when the first frame of the new place has been taken, otherwise why the old one goes on.
using JumpDone = std::function<void(const Error* error)>;

/// Of one moment.
struct PlaylistStatus {
  std::string list;
  std::string source;  ///< that is being taken from; empty if none is
  std::optional<size_t> item{};
  size_t items = 0;
  std::optional<uint64_t> frames{};  ///< of one round of the item, if known
  uint64_t rounds_done = 0;
  uint64_t started = 0;
  uint64_t seams = 0;
  uint64_t skipped = 0;
  std::string last_trouble{};
  frames::FrameDamage damage{};  ///< of all items, so far
  /// The items that had any, by source.
  std::map<std::string, frames::FrameDamage> damaged_items{};
  bool opening = false;  ///< somewhere else is being opened
};

/// FrameSource's functions on one thread, the others on any. Frames of all items have the panel's
/// size; an item of another size counts as broken. Never fails: where nothing can be played, it
/// owes nothing.
class PlaylistSource final : public frames::FrameSource {
 public:
  /// Throws Error(Failed) when no descriptor is left. Opens nothing yet.
  PlaylistSource(std::shared_ptr<const Playlist> list, PlaylistSourceOptions options);
  ~PlaylistSource() override;
  PlaylistSource(const PlaylistSource&) = delete;
  PlaylistSource& operator=(const PlaylistSource&) = delete;

  /// Opens the first item on this thread, so that a list of one that cannot be played is an error
  /// at once. Throws what the opener throws, after a list's last item; before anything is pulled.
  void open_first();
  /// What items without a rate are played at; before anything is pulled.
  void set_display_rate(frames::Rate rate) { display_rate_ = rate; }

  /// One at a time: a new one takes the place of one that is not done, which fails.
  void jump(Jump jump, JumpDone done);
  /// Loops of the list, or of its only item; kForever. From the next seam on.
  void set_loops(uint64_t loops);
  /// While it is held, the list does not end: it is paused, and may be sent elsewhere.
  void hold(bool held);
  /// Looks at list and item without waiting for the next second, and reads the list even if it is
  /// the same.
  void look_again();
  [[nodiscard]] PlaylistStatus status() const;
  /// The source that a frame's `item` came from, as long as it is remembered; empty otherwise.
  [[nodiscard]] std::string source_of(uint32_t play) const;
  /// Its place in the list, if it is remembered and in the list.
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

  /// One item that is open.
  struct Play {
    std::shared_ptr<const Playlist> list;
    PlaylistItem item;
    std::optional<size_t> index;  ///< none: standby
    uint64_t rounds_done = 0;     ///< of the list, when it was chosen
    uint64_t first_frame = 0;
    std::vector<FileMark> files;  ///< as they were before it was opened
    OpenedSource opened;

    uint32_t number = 0;  ///< counted over everything that began
    uint64_t pulled = 0;
    uint64_t pulled_this_round = 0;
    uint64_t loops_done = 0;
    uint64_t lent = 0;
    frames::FrameDamage damage{};  ///< as far as it is counted in the status
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
  /// What the opening thread watches: the item that is playing.
  struct Followed {
    uint32_t number = 0;  ///< 0: nothing
    PlaylistItem item{};
    std::vector<FileMark> files{};
    std::vector<FileMark> seen{};  ///< at the last look
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

  // Either.
  void count_skipped(const std::string& source, const std::string& why);
  void tell(PlaylistEvent::Kind kind, const std::string& source, const std::string& detail = {});
  void wake_filler() const;

  const PlaylistSourceOptions options_;
  frames::Rate display_rate_{60, 1};
  UniqueFd wake_;
  UniqueFd poll_;  ///< wakes for wake_ and for what the current item waits for

  // Filling thread only.
  std::unique_ptr<Play> current_;
  std::vector<std::unique_ptr<Play>> retired_;  ///< some of whose frames are lent
  std::vector<Lent> lent_;
  std::optional<frames::LentFrame> in_hand_;  ///< the first frame after a jump
  std::optional<frames::Rate> rate_;
  uint64_t next_token_ = 1;
  uint32_t next_number_ = 1;
  uint64_t cut_ = 0;
  bool idle_ = false;
  bool at_end_ = false;
  bool next_asked_ = false;

  mutable std::mutex mutex_;  ///< guards what follows; nobody opens or decodes under it
  std::condition_variable work_there_;
  std::shared_ptr<const Playlist> list_;
  std::optional<size_t> position_;  ///< in the list, of the item chosen last
  uint64_t rounds_done_ = 0;
  std::unique_ptr<Play> next_;
  bool next_wanted_ = false;
  bool list_over_ = false;
  bool held_ = false;
  bool ended_ = false;            ///< End was said, which is final
  bool nothing_for_now_ = false;  ///< no item is for this time
  bool on_standby_ = false;
  size_t broken_in_a_row_ = 0;
  SteadyTime retry_at_{};
  std::optional<Wish> wish_;
  uint64_t wish_serial_ = 0;
  std::vector<std::unique_ptr<Play>> trash_;
  Followed followed_;
  std::unique_ptr<Play> replacement_;  ///< for the item of followed_, from its next seam on
  std::optional<FileMark> list_seen_;  ///< at the last look
  bool outdated_ = false;  ///< the item that is playing is not in the list any more as it was
  bool look_now_ = false;
  SteadyTime look_at_{};
  std::deque<Began> began_;
  PlaylistStatus status_;
  bool stopping_ = false;

  std::thread worker_;  // last: it uses everything above
};

}  // namespace lenticule::player
