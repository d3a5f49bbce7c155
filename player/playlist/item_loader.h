// SPDX-License-Identifier: Apache-2.0
// ItemLoader opens and closes the items of a playlist on a thread of its own, because both may take
// long: the next item ahead of time, the target of a jump, a cued item, and files that were
// replaced.
//
// Its state has five parts, which a mutex guards together: the next item (Next), a jump that is not
// done yet and a cued item (two JumpSlots), the playing item (Playing), what went wrong (Faults),
// and the state of the files (Checks). The PlaylistCursor knows the place in the list.
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
#include "base/unique_fd.h"
#include "player/playlist/open_item.h"
#include "player/playlist/playlist_cursor.h"
#include "player/playlist/playlist_reporter.h"

namespace lenticule::player {

/// Called with null when the first frame of the new place has been taken, otherwise with the reason
/// why the old item continues.
using JumpDone = std::function<void(const Error* error)>;

/// Thread safety: the functions are called on any thread, and must not call back into the source.
struct PlaylistSourceOptions {
  frames::FrameGeometry panel = {};
  ItemOpener open;
  /// The rate at which all items are played, overriding their own.
  std::optional<frames::Rate> rate = std::nullopt;
  std::function<LocalTime()> local_time = local_time_now;
  PlaylistReporter::OnEvent on_event = nullptr;
  /// Returns the state of an item's files; two results are equal as long as no file was replaced.
  /// Replaced files take effect at the item's next loop point. Null: they are not detected.
  std::function<std::vector<FileMark>(const PlaylistItem& item)> marks_of = nullptr;
  /// Reads a list again, which takes effect at once. Throws Error; may take long. Null: a replaced
  /// list is not detected.
  std::function<Playlist(const std::string& name)> read_list = nullptr;
  /// Returns the state of a list's file. Null: mark_of(), for lists in files.
  std::function<FileMark(const std::string& name)> mark_list = nullptr;
  /// Once a frame was played, broken files do not end the list: its items are tried again, and a
  /// test card is shown if that does not help for ten seconds.
  bool outlasts_faults = false;
  /// Returns the last displayed frame of an item, by its running number; null = the last one that
  /// was pulled counts as displayed.
  std::function<LeftItem(uint32_t number)> left_item = nullptr;
  /// The source ends if no item could be played for this long since open_first(); none = it shows
  /// black and waits.
  std::optional<std::chrono::nanoseconds> longest_wait = std::nullopt;
};

/// Thread safety: each function says on which thread it runs. The frame copier is the thread that
/// takes frames; items are handed over, so that only one thread at a time uses an OpenItem. `wake`
/// is signalled when the frame copier may find something new.
class ItemLoader {
 public:
  /// Lifetime: `options`, `reporter` and `wake` must outlive the loader.
  ItemLoader(std::shared_ptr<const Playlist> list, const PlaylistSourceOptions& options,
             PlaylistReporter& reporter, WakeFd& wake);
  /// Ends the thread. A pending jump fails.
  ~ItemLoader();
  ItemLoader(const ItemLoader&) = delete;
  ItemLoader& operator=(const ItemLoader&) = delete;

  /// Opens the only item of a list on the calling thread, or begins to look for the first item that
  /// can be played. Throws as ItemOpener does. Called before the frame copier begins.
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
    Idle,   ///< no frame is due: a pause, a time without items, only broken items, a jump
    Soon,   ///< an item is being opened
  };
  /// Returns the prospect of a frame copier without an item.
  [[nodiscard]] Prospect prospect();

  // The playing item. Thread safety: the frame copier.
  void begin(const OpenItem& item);
  void leave();
  void note_first_frame(const OpenItem& item);
  /// An item that cannot be played, or not any further.
  struct Fault {
    std::string source;
    std::string why;
    bool standby = false;
    bool played = false;      ///< frames of it were played
    uint64_t loops_done = 0;  ///< loops of it that were played
  };
  /// Counts and reports an item that is left out.
  void skip(const Fault& fault);
  void close(std::unique_ptr<OpenItem> item);
  [[nodiscard]] uint64_t loops_of(const OpenItem& item) const;
  /// Returns true if the list was replaced by one that does not continue the playing item.
  [[nodiscard]] bool is_outdated() const;
  /// Returns the item of that number with its new files; null if they were not replaced.
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
  /// Moves the list to the target, and returns the function to call then. Null if another jump was
  /// requested meanwhile. `leaving` is the progress of the playing item.
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

  /// The item that follows the playing one.
  struct Next {
    std::unique_ptr<OpenItem> item{};
    bool wanted = false;
    bool list_over = false;        ///< the last round is over
    bool nothing_for_now = false;  ///< no item is scheduled now
    SteadyTime retry_at{};
    [[nodiscard]] bool is_due() const { return wanted && !item && !list_over; }
  };

  struct JumpRequest {
    PlaylistPlace place{};
    uint64_t frame = 0;
    bool returns = false;          ///< to the interrupted item
    bool in_present_list = false;  ///< names an item of the list that is played
    uint64_t serial = 0;
    JumpDone done{};
    SteadyTime since{};
    bool opened = false;   ///< opening has begun
    bool decoded = false;  ///< cue: the first frames are decoded
    /// Null until it is open, and while the frame copier tries it.
    std::unique_ptr<OpenItem> item{};
  };
  /// JumpSlot holds a jump that is not done yet, or a cued one. A later request replaces it.
  struct JumpSlot {
    std::optional<JumpRequest> request{};
    uint64_t serial = 0;  ///< changes when an item that is being opened is not wanted any more
    SteadyTime due{};     ///< time of the next step towards the target

    [[nodiscard]] bool holds(uint64_t number) const { return request && request->serial == number; }
    [[nodiscard]] bool is_to_open() const { return request && !request->opened; }
    [[nodiscard]] bool is_to_decode() const {
      return request && request->item && !request->decoded;
    }
    /// Ends the request and returns the function to call.
    [[nodiscard]] JumpDone end() { return std::move(std::exchange(request, std::nullopt)->done); }
  };

  /// The playing item, whose files are checked.
  struct Playing {
    uint32_t number = 0;  ///< 0: none
    bool standby = false;
    uint64_t rounds_done = 0;
    PlaylistItem item{};
    std::vector<FileMark> files{};
    std::vector<FileMark> seen{};             ///< state at the last check
    std::unique_ptr<OpenItem> replacement{};  ///< replaces the item at its loop point
    bool outdated = false;  ///< the new list no longer contains the item unchanged
  };

  /// Faults describes what went wrong since the last item that could be played.
  struct Faults {
    bool broke_off = false;          ///< the last item broke, and no other has begun
    size_t unplayable_in_a_row = 0;  ///< items without a frame that could be shown
    std::string problem{};           ///< reason why the last of these cannot be played
    uint64_t loops_done = 0;         ///< loops that the last broken item had done
    SteadyTime since{};              ///< since when nothing works and no file changes
    std::vector<FileMark> files{};   ///< state of a broken item's files; loader thread only
    bool standby_broken = false;     ///< until the next pause between attempts
  };

  /// The checks of the files of the list and of the playing item.
  struct Checks {
    bool at_once = false;  ///< reads the list even if its file is the same
    SteadyTime due{};
    std::optional<FileMark> list_seen{};  ///< state of the list's file at the last check
  };

  /// The outcome of an attempt to open an item.
  struct Attempt {
    std::unique_ptr<OpenItem> item{};
    std::optional<Error> error{};
  };

  // Loader thread. Functions with a lock release it while they open, close or read files.
  void work();
  [[nodiscard]] SteadyTime next_step() const;
  void empty_trash(Lock& lock);
  void open_next(Lock& lock);
  void open_target(Lock& lock, JumpSlot& slot);
  void open_interrupted(Lock& lock);
  void look_at_cued(Lock& lock);
  [[nodiscard]] bool is_time_to_check() const;
  void check_files(Lock& lock);
  void check_list(Lock& lock, bool at_once);
  void check_item(Lock& lock);

  // Any thread. `locked_`: the caller holds the mutex.
  [[nodiscard]] std::unique_ptr<OpenItem> open_item(const PlaylistItem& item, uint64_t frame) const;
  [[nodiscard]] Attempt try_open(const PlaylistItem& item, uint64_t frame) const;
  void locked_offer(std::unique_ptr<OpenItem> item, const NextItem& pick);
  void locked_discard(std::unique_ptr<OpenItem>& item);
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
  [[nodiscard]] FileMark mark_of_list(const std::string& name) const;
  [[nodiscard]] bool is_list_changed(const Playlist& list) const;
  void locked_take_list(Playlist list);
  /// Puts the request that `locked_make` returns into the slot, and fails the one that it replaces.
  /// An exception of `locked_make` fails the new one. None: nothing is requested.
  void put_request(JumpSlot& slot, const JumpDone& done,
                   const std::function<std::optional<JumpRequest>()>& locked_make);
  /// Finds the progress of the interrupted item once the panel shows another item, or at `give_up`:
  /// a panel that is off or away shows none. Returns false until then.
  [[nodiscard]] bool locked_find_progress(SteadyTime give_up = SteadyTime::max());
  void locked_end_interruption();
  void locked_leave_interruption();
  [[nodiscard]] bool locked_follow_list(JumpRequest& cue) const;

  const PlaylistSourceOptions& options_;
  PlaylistReporter& reporter_;
  WakeFd& wake_;

  /// Guards the members below. Items are never opened, closed or decoded while it is locked.
  mutable std::mutex mutex_;
  std::condition_variable work_there_;
  PlaylistCursor cursor_;
  Next next_;
  JumpSlot jump_, cue_;
  ItemProgress interrupted_;  ///< number 0: nothing is interrupted
  Playing playing_;
  Faults faults_;
  Checks checks_;
  std::vector<std::unique_ptr<OpenItem>> trash_;  ///< items to close
  bool shown_ = false;                            ///< a frame of any item was taken
  bool held_ = false;
  bool ended_ = false;  ///< the frame copier was told that the list is over
  bool stopping_ = false;

  std::thread thread_;  // last member: the thread uses everything above
};

}  // namespace lenticule::player
