// SPDX-License-Identifier: Apache-2.0
// ItemLoader opens and closes the items of a playlist on a thread of its own,
// because both may take long: the next item ahead of time, the target of a
// jump, and files that were replaced.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/wake_fd.h"
#include "player/playlist/open_item.h"
#include "player/playlist/playlist_cursor.h"
#include "player/playlist/playlist_reporter.h"

namespace lenticule::player {

/// Returns the state of an item's files; two results are equal as long as no
/// file was replaced. Thread safety: any thread.
using ItemLook = std::function<std::vector<FileMark>(const PlaylistItem& item)>;
/// Returns the last displayed frame of an item, by its running number. Thread safety: any thread.
using LeftItemLook = std::function<LeftItem(uint32_t number)>;
/// Returns the state of a list's file. Thread safety: any thread.
using ListMark = std::function<FileMark(const std::string& name)>;
/// Reads a list again. Throws Error. Thread safety: any thread; may take long.
using ListReader = std::function<Playlist(const std::string& name)>;
/// Called with null when the first frame of the new place has been taken,
/// otherwise with the reason why the old item continues.
using JumpDone = std::function<void(const Error* error)>;

struct ItemLoaderOptions {
  frames::FrameGeometry panel = {};
  ItemOpener open;
  std::function<LocalTime()> local_time;
  ItemLook look_at = nullptr;      ///< null: replaced files of items are not detected
  ListReader read_list = nullptr;  ///< null: a replaced list is not detected
  ListMark mark_list = nullptr;    ///< null: mark_of(), for lists in files
  bool outlasts_faults = false;    ///< as in PlaylistSourceOptions
  /// Null: after an interruption, an item continues with the last frame that was taken of it.
  LeftItemLook left_item = nullptr;
};

/// Thread safety: each function says on which thread it runs. The frame copier is the
/// thread that takes frames; items are handed over, so that only one thread at
/// a time uses an OpenItem. `wake` is signalled when the frame copier may find
/// something new.
class ItemLoader {
 public:
  /// Lifetime: `reporter` and `wake` must outlive the loader.
  ItemLoader(std::shared_ptr<const Playlist> list, ItemLoaderOptions options,
             PlaylistReporter& reporter, WakeFd& wake);
  /// Ends the thread. A pending jump fails.
  ~ItemLoader();
  ItemLoader(const ItemLoader&) = delete;
  ItemLoader& operator=(const ItemLoader&) = delete;

  /// Opens the only item of a list on the calling thread, or begins to look for
  /// the first item that can be played. Throws as ItemOpener does. Called
  /// before the frame copier begins.
  void open_first();

  // The next item. Thread safety: the frame copier.
  struct Offer {
    std::unique_ptr<OpenItem> item;  ///< null: none is ready
    bool primes = false;             ///< it is open, and waits until its pool is full
  };
  [[nodiscard]] Offer take_next();
  void want_next();
  [[nodiscard]] bool next_is_there() const;
  enum class Prospect {
    Ended,  ///< the list is over, which is final
    Idle,   ///< no frame is due: a pause, a time without items, only broken
            ///< items, a jump
    Soon,   ///< an item is being opened
  };
  /// Returns the prospect of a frame copier without an item.
  [[nodiscard]] Prospect prospect();

  // The playing item. Thread safety: the frame copier.
  void begin(const OpenItem& item);
  void leave();
  void note_first_frame(const OpenItem& item);
  /// Counts and reports an item that cannot be played, or, if it was `played`, not any further,
  /// after `loops_done`.
  void skip(const std::string& source, const std::string& why, bool standby, bool played,
            uint64_t loops_done);
  void close(std::unique_ptr<OpenItem> item);
  [[nodiscard]] uint64_t loops_of(const OpenItem& item) const;
  /// Returns true if the list was replaced by one that does not continue the
  /// playing item.
  [[nodiscard]] bool is_outdated() const;
  /// Returns the item of that number with its new files; null if they were not
  /// replaced.
  [[nodiscard]] std::unique_ptr<OpenItem> take_replacement(uint32_t number);

  // The target of a jump. Thread safety: the frame copier.
  struct Arrival {
    std::unique_ptr<OpenItem> item;
    uint64_t serial = 0;
    std::chrono::steady_clock::time_point since{};  ///< time of the request
  };
  /// Returns the target if it is open; its first frame is still to come.
  [[nodiscard]] std::optional<Arrival> take_arrival();
  void put_back(Arrival arrival);
  /// Moves the list to the target, and returns the function to call then. Null
  /// if another jump was requested meanwhile. `leaving` is the progress of the playing item.
  [[nodiscard]] JumpDone accept(uint64_t serial, const ItemProgress& leaving);
  void fail(Arrival arrival, const Error& error);

  // Thread safety: any thread.
  void jump(const Jump& jump, const JumpDone& done);
  /// Ends an interruption at once. Fails if nothing is interrupted.
  void return_now(const JumpDone& done);
  /// Opens the target of a jump and decodes its first frames. `done` is called when that is done.
  /// The list does not end while an item is cued.
  void cue(const Jump& jump, const JumpDone& done);
  /// Jumps to the cued item. Fails if none is cued, or not completely yet.
  void go(const JumpDone& done);
  /// Returns the source of the cued item; empty if none is cued.
  [[nodiscard]] std::string cued() const;
  /// Returns the source that is played after the present interruption; empty without one.
  [[nodiscard]] std::string interrupted() const;
  void set_loops(uint64_t loops);
  void hold(bool held);
  void look_again();
  [[nodiscard]] bool is_jumping() const;
  /// Returns the list that is played, or that continues after the present interruption.
  [[nodiscard]] std::shared_ptr<const Playlist> list() const;

 private:
  using SteadyTime = std::chrono::steady_clock::time_point;
  using Lock = std::unique_lock<std::mutex>;

  /// A requested jump.
  struct JumpRequest {
    PlaylistPlace place{};
    uint64_t frame = 0;
    uint64_t serial = 0;
    bool opened = false;
    bool returns = false;          ///< to the interrupted item
    bool decoded = false;          ///< cue: the first frames are decoded
    bool in_present_list = false;  ///< cue: names an item of the list that is played
    std::unique_ptr<OpenItem>
        item{};  ///< null until it is open, and while the frame copier tries it
    JumpDone done{};
    SteadyTime since{};
  };
  /// The playing item, whose files are checked.
  struct Followed {
    uint32_t number = 0;  ///< 0: none
    bool standby = false;
    uint64_t rounds_done = 0;
    PlaylistItem item{};
    std::vector<FileMark> files{};
    std::vector<FileMark> seen{};  ///< state at the last check
  };

  // Loader thread. Functions with a lock release it while they open, close or
  // read files.
  void work();
  void empty_trash(Lock& lock);
  [[nodiscard]] SteadyTime next_step() const;
  void open_requested(Lock& lock);
  void open_next(Lock& lock);
  void open_interrupted(Lock& lock);
  void open_cued(Lock& lock);
  void look_at_cued(Lock& lock);
  [[nodiscard]] bool is_time_to_look() const;
  void look_at_list(Lock& lock, bool at_once);
  void look_at_item(Lock& lock);

  /// The outcome of an attempt to open an item.
  struct Attempt {
    std::unique_ptr<OpenItem> item;
    std::optional<Error> error;
  };
  // Any thread. `locked_`: the caller holds the mutex.
  [[nodiscard]] Attempt try_open(const PlaylistItem& item, uint64_t frame) const;
  [[nodiscard]] FileMark mark_of_list(const std::string& name) const;
  [[nodiscard]] bool is_list_changed(const Playlist& list) const;
  /// Returns true if each item that is scheduled now was tried in vain.
  [[nodiscard]] bool locked_none_works() const;
  /// Returns true if nothing works any more, and this does not end the list.
  [[nodiscard]] bool locked_outlasts() const;
  [[nodiscard]] bool is_changing(const PlaylistItem& item);
  /// Returns the item for times without one of the list: the default, otherwise black for as long
  /// as the panel has no frame, and a test card after a while. None: the last frame stays.
  [[nodiscard]] std::optional<PlaylistItem> locked_standby() const;
  /// Returns the same; none if it plays already.
  [[nodiscard]] std::optional<PlaylistItem> locked_standby_to_open() const;
  void locked_pause();
  /// Returns what the list waits for; empty if it does not wait.
  [[nodiscard]] std::string locked_reason_to_wait(LocalTime now) const;
  void locked_note_unplayable(bool standby, const std::string& problem);
  /// Requests a jump, replacing a pending one, for which it returns the function to call.
  [[nodiscard]] JumpDone locked_request(JumpRequest request);
  /// Finds the progress of the interrupted item once the panel shows another item, or at `give_up`:
  /// a panel that is off or away shows none. Returns false until then.
  [[nodiscard]] bool locked_find_progress(SteadyTime give_up = SteadyTime::max());
  void locked_end_interruption();
  [[nodiscard]] bool locked_follow_list(JumpRequest& cue) const;
  [[nodiscard]] std::unique_ptr<OpenItem> open_item(const PlaylistItem& item, uint64_t frame) const;
  void locked_offer(std::unique_ptr<OpenItem> item, const NextItem& pick);
  void locked_discard(std::unique_ptr<OpenItem>& item);
  void locked_take_list(Playlist list);

  const ItemLoaderOptions options_;
  PlaylistReporter& reporter_;
  WakeFd& wake_;

  /// Guards the members below. Items are never opened, closed or decoded while
  /// it is locked.
  mutable std::mutex mutex_;
  std::condition_variable work_there_;
  PlaylistCursor cursor_;
  std::unique_ptr<OpenItem> next_;
  bool next_wanted_ = false;
  std::optional<JumpRequest> request_;
  uint64_t request_serial_ =
      0;                     ///< changes when an item that is being opened is not wanted any more
  SteadyTime request_at_{};  ///< time of the next attempt to open its target
  std::optional<JumpRequest> cue_;
  uint64_t cue_serial_ = 0;
  SteadyTime cue_look_at_{};
  ItemProgress interrupted_;               ///< number 0: nothing is interrupted
  std::unique_ptr<OpenItem> replacement_;  ///< replaces the item of followed_ at its loop point
  std::vector<std::unique_ptr<OpenItem>> trash_;  ///< items to close
  Followed followed_;
  bool outdated_ = false;   ///< the new list no longer contains the playing item unchanged
  bool list_over_ = false;  ///< the last round is over
  bool held_ = false;
  bool ended_ = false;                    ///< the frame copier was told that the list is over
  bool nothing_for_now_ = false;          ///< no item is scheduled now
  bool broke_off_ = false;                ///< the last item broke, and no other has begun
  size_t unplayable_in_a_row_ = 0;        ///< items without a frame that could be shown
  std::string problem_;                   ///< reason why the last of these cannot be played
  uint64_t broken_loops_ = 0;             ///< loops that the last broken item had done
  SteadyTime broken_since_{};             ///< since when nothing works and no file changes
  std::vector<FileMark> broken_files_{};  ///< state of a broken item's files; loader thread only
  bool standby_broken_ = false;           ///< until the next pause between attempts
  bool shown_ = false;                    ///< a frame of any item was taken
  SteadyTime retry_at_{};
  bool look_now_ = false;
  SteadyTime look_at_{};
  std::optional<FileMark> list_seen_;  ///< state of the list's file at the last check
  bool stopping_ = false;

  std::thread thread_;  // last member: the thread uses everything above
};

}  // namespace lenticule::player
