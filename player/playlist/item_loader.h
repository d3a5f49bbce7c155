// SPDX-License-Identifier: Apache-2.0
// ItemLoader opens and closes the items of a playlist on a thread of its own, because both may take
// long: the next item ahead of time, the target of a jump, a cued item, and files that were
// replaced.
//
// Its state has five parts, which a mutex guards together: the next item (Next), a jump that is not
// done yet and a cued item (two JumpSlots), the playing item (Playing), what went wrong (Faults),
// and the state of the files (Checks). The PlaylistCursor knows the place in the list.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/unique_fd.h"
#include "player/playlist/folder_lists.h"
#include "player/playlist/open_item.h"
#include "player/playlist/playlist.h"
#include "player/playlist/playlist_reporter.h"

namespace lenticule::player {

/// The target of a jump.
struct Jump {
  std::shared_ptr<const Playlist> list = nullptr;  ///< null: the list that is playing
  /// Null: the item that is playing; -1 or 1 with `relative`.
  std::optional<int64_t> item = std::nullopt;
  bool relative = false;
  /// The item on the panel, from which a relative jump counts; null: from the playing item, whose
  /// frames are read ahead.
  std::optional<ItemAccount> displayed = std::nullopt;
  uint64_t frame = 0;
  /// The target is a list that is played once; then the playing item continues where it was.
  bool interrupts = false;
};

/// A jump's list and item.
struct PlaylistPlace {
  std::shared_ptr<const Playlist> list;
  size_t index = 0;
  int64_t rounds_done = 0;
  bool interrupts = false;
};

/// The place in a list at which an interruption began.
struct InterruptedPlace {
  std::shared_ptr<const Playlist> list;
  std::optional<size_t> playing;  ///< none: standby, or no item
  std::optional<size_t> chosen;
  int64_t rounds_done = 0;
};

/// PlaylistCursor is the place in a playlist: the item that plays, the one chosen last, and the
/// rounds. Thread safety: one thread at a time; ItemLoader uses it under its mutex.
class PlaylistCursor {
 public:
  explicit PlaylistCursor(std::shared_ptr<const Playlist> list) : list_(std::move(list)) {}

  /// Returns the list; a changed list has another address.
  [[nodiscard]] const std::shared_ptr<const Playlist>& list() const { return list_; }
  [[nodiscard]] int64_t rounds_done() const { return rounds_done_; }

  /// Returns the item after the one chosen last.
  [[nodiscard]] NextItem next(LocalTime now) const {
    return next_item(*list_, chosen_, rounds_done_, now);
  }
  /// Chooses an item of the list.
  void choose(size_t index, int64_t rounds_done) {
    chosen_ = index;
    rounds_done_ = rounds_done;
  }
  /// Notes the item that plays from now on; none for standby.
  void begin(std::optional<size_t> index, int64_t rounds_done) {
    playing_ = index;
    playing_rounds_ = rounds_done;
  }
  /// Forgets an item that was chosen ahead and will not be played. Returns false if none plays.
  bool back_to_playing() {
    if (playing_) choose(*playing_, playing_rounds_);
    return playing_.has_value();
  }

  /// Returns the place at which a jump arrives. During an interruption, items are those of the
  /// interrupted list. Throws Error(Usage) for an item that the list does not have.
  [[nodiscard]] PlaylistPlace target_of(const Jump& jump) const {
    const bool leaves = interrupted_ && (jump.item || jump.relative);
    const InterruptedPlace at = leaves ? *interrupted_ : here();
    const auto list = jump.list ? jump.list : at.list;
    const auto items = static_cast<int64_t>(list->items.size());
    const size_t item_here = (at.playing ? at.playing : at.chosen).value_or(0);
    if (items == 0)
      throw failed_error("{}: has no item at the moment", list->name)
          .remedy("wait for a file, or load another source");
    int64_t index = jump.item.value_or(0);
    int64_t rounds_done = jump.list ? 0 : at.rounds_done;
    if (jump.relative) {
      ListPlace from{item_here, rounds_done};
      if (jump.displayed && list->has(jump.displayed->index, jump.displayed->source))
        from = {*jump.displayed->index, jump.displayed->rounds_done};
      from = list->beside(from, static_cast<int>(index));
      index = static_cast<int64_t>(from.index);
      rounds_done = from.round;
    }
    if (!jump.item && !jump.list) index = static_cast<int64_t>(item_here);
    if (index < 0 || index >= items)
      throw usage_error("item {}: the list has {} items", index, items)
          .remedy("items are counted from 0");
    return {.list = list,
            .index = static_cast<size_t>(index),
            .rounds_done = rounds_done,
            .interrupts = jump.interrupts};
  }
  /// Moves to the place. An interruption keeps the place that it interrupts; a second one keeps the
  /// place of the first. A jump to another list ends the interruption.
  void jump(const PlaylistPlace& place) {
    if (place.interrupts && !interrupted_) interrupted_ = here();
    if (!place.interrupts && place.list != list_) interrupted_.reset();
    list_ = place.list;
    choose(place.index, place.rounds_done);
  }
  /// Returns the place to which an interruption returns; none if nothing is interrupted.
  [[nodiscard]] const std::optional<InterruptedPlace>& interrupted() const { return interrupted_; }
  /// Ends the interruption: the interrupted list continues after its item.
  void end_interruption() {
    if (!interrupted_) return;
    const InterruptedPlace place = *std::exchange(interrupted_, std::nullopt);
    list_ = place.list;
    chosen_ = place.playing ? place.playing : place.chosen;
    rounds_done_ = place.rounds_done;
  }

  /// Sets the loops of the list, or of its only item, from now on.
  void set_loops(uint64_t loops) {
    auto list = std::make_shared<Playlist>(*list_);
    if (list->items.size() == 1) list->items.front().loops = loops;
    if (list->items.size() > 1) list->rounds = loops;
    rounds_done_ = playing_rounds_ = 0;
    list_ = std::move(list);
  }
  /// Notes the state of the list's file, which is not read until it changes again.
  void keep_list(const FileMark& file) {
    auto kept = std::make_shared<Playlist>(*list_);
    kept->file = file;
    list_ = std::move(kept);
  }
  /// Replaces the list. If it contains `playing` (null: no item of a list is playing), the item
  /// continues there. Otherwise the item that follows it in the new list is next. Returns true if
  /// the item continues.
  bool replace_list(std::shared_ptr<const Playlist> list, const PlaylistItem* playing) {
    list_ = std::move(list);
    const std::vector<PlaylistItem>& items = list_->items;
    if (playing == nullptr) {
      if (chosen_ && *chosen_ >= items.size()) chosen_.reset();
      return false;
    }
    const size_t near = playing_.value_or(0);
    rounds_done_ = rounds_here();
    chosen_ = nearest_place(items, near, [&](const auto& item) { return item == *playing; });
    if (chosen_) {
      playing_ = chosen_;
      return true;
    }
    // Changed settings of the item take effect when it begins again, so the item itself is next.
    const auto changed = nearest_place(
        items, near, [&](const auto& item) { return item.source == playing->source; });
    if (changed && *changed > 0) chosen_ = *changed - 1;
    return false;
  }
  /// Returns the place of the item that plays, or that played last; none for standby.
  [[nodiscard]] std::optional<size_t> playing() const { return playing_; }

 private:
  [[nodiscard]] InterruptedPlace here() const { return {list_, playing_, chosen_, rounds_here()}; }
  [[nodiscard]] int64_t rounds_here() const { return playing_ ? playing_rounds_ : rounds_done_; }
  /// Returns the place of the item that satisfies the condition; of several, the nearest to `near`.
  template <class Condition>
  static std::optional<size_t> nearest_place(const std::vector<PlaylistItem>& items, size_t near,
                                             Condition condition) {
    const auto distance = [near](size_t place) {
      return place < near ? near - place : place - near;
    };
    std::optional<size_t> nearest;
    for (size_t place = 0; place < items.size(); ++place)
      if (condition(items[place]) && (!nearest || distance(place) < distance(*nearest)))
        nearest = place;
    return nearest;
  }

  std::shared_ptr<const Playlist> list_;
  std::optional<size_t> chosen_;
  std::optional<size_t> playing_;
  int64_t rounds_done_ = 0;     ///< before that of the chosen item
  int64_t playing_rounds_ = 0;  ///< before that of the playing one, from which jumps count
  std::optional<InterruptedPlace> interrupted_;
};

/// Called with null when the first frame of the new place has been taken, otherwise with the reason
/// why the old item continues.
using JumpDone = std::function<void(const Error* error)>;

/// Thread safety: the functions are called on any thread, and must not call back into the source.
struct PlaylistSourceOptions {
  frames::FrameGeometry panel = {};
  std::vector<frames::FrameGeometry> panels = {};  ///< the panels of a wall; empty for one panel
  ItemOpener open;
  /// The rate at which all items are played, overriding their own.
  std::optional<frames::Rate> rate = std::nullopt;
  std::function<LocalTime()> local_time = local_time_now;
  std::function<std::time_t()> clock = [] { return std::time(nullptr); };  ///< shown by overlays
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

  /// Returns the pictures of a frame that overlays are drawn over.
  [[nodiscard]] std::span<const frames::FrameGeometry> overlaid_panels() const {
    return panels.empty() ? std::span(&panel, 1) : std::span(panels);
  }
};

/// Thread safety: each function says on which thread it runs. The frame copier is the thread that
/// takes frames; items are handed over, so that only one thread at a time uses an OpenItem. `wake`
/// is signalled when the frame copier may find something new.
class ItemLoader {
 public:
  /// Lifetime: `options`, `reporter` and `wake` must outlive the loader.
  ItemLoader(std::shared_ptr<const Playlist> list, const PlaylistSourceOptions& options,
             PlaylistReporter& reporter, WakeFd& wake)
      : options_(options), reporter_(reporter), wake_(wake), cursor_(std::move(list)) {
    thread_ = std::thread([this] { work(); });
  }
  /// Ends the thread. A pending jump fails.
  ~ItemLoader() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    work_there_.notify_all();
    thread_.join();
    const Error ending(ErrorKind::Failed, "load: the player is ending");
    for (const JumpSlot* slot : {&jump_, &cue_})
      if (slot->request && slot->request->done) slot->request->done(&ending);
  }

  /// Opens the only item of a list on the calling thread, or begins to look for the first item that
  /// can be played. Throws as ItemOpener does. Called before the frame copier begins.
  void open_first() {
    const std::shared_ptr<const Playlist> list = this->list();
    std::unique_ptr<OpenItem> first;
    // A list that repeats waits for its only item, as for one of several.
    const bool waits = list->file && (options_.outlasts_faults || list->rounds != 1);
    if (list->is_single() && !list->items.front().schedule && !waits)
      first = open_item(list->items.front(), 0);
    const std::lock_guard lock(mutex_);
    next_.requested = first == nullptr;
    if (first) locked_offer(std::move(first), {.kind = NextItem::Kind::Item});
    work_there_.notify_all();
  }

  // The next item. Thread safety: the frame copier.
  struct Offer {
    std::unique_ptr<OpenItem> item;  ///< null: none is ready
    bool primes = false;             ///< it is open, and waits until its pool is full
  };
  [[nodiscard]] Offer take_next() {
    const std::lock_guard lock(mutex_);
    if (!next_.item && !next_.list_over && !next_.requested) {
      next_.requested = true;
      work_there_.notify_all();
    }
    if (!next_.item) return {};
    if (next_.item->item.waits_until_primed && !next_.item->opened.source->saturated())
      return {.item = nullptr, .primes = true};
    return {.item = std::move(next_.item)};
  }
  void want_next() {
    const std::lock_guard lock(mutex_);
    next_.requested = true;
    work_there_.notify_all();
  }
  [[nodiscard]] bool next_is_there() const {
    const std::lock_guard lock(mutex_);
    return next_.item != nullptr;
  }
  enum class Prospect {
    Ended,  ///< the list is over, which is final
    Idle,   ///< no frame is due: a pause, a time without items, only broken items, a jump
    Soon,   ///< an item is being opened
  };
  /// Returns the prospect of a frame copier without an item.
  [[nodiscard]] Prospect prospect() {
    const std::lock_guard lock(mutex_);
    ended_ = next_.list_over && !jump_.request && !cue_.request && !next_.item && !held_;
    if (ended_) return Prospect::Ended;
    const bool idle = held_ || next_.nothing_for_now || faults_.broke_off || jump_.request ||
                      (next_.list_over && cue_.request);
    return idle ? Prospect::Idle : Prospect::Soon;
  }

  // The playing item. Thread safety: the frame copier.
  void begin(const OpenItem& item) {
    const std::lock_guard lock(mutex_);
    locked_discard(playing_.replacement);
    playing_ = {.number = item.number,
                .standby = !item.index,
                .rounds_done = item.rounds_done,
                .item = item.item,
                .files = item.files,
                .seen = item.files};
    if (std::exchange(jumped_, false)) jumped_to_ = item.number;
    if (item.returns && cursor_.interrupted()) locked_end_interruption();
    cursor_.begin(item.index, item.rounds_done);
    if (!item.index) locked_pause();
  }
  void leave() {
    const std::lock_guard lock(mutex_);
    locked_discard(playing_.replacement);
    playing_ = {};
  }
  /// Gives an open ring the list's next turn, because a socket cannot be opened twice. Returns
  /// false if another item is next.
  [[nodiscard]] bool takes_next_turn(OpenItem& item) {
    const std::lock_guard lock(mutex_);
    const NextItem pick = cursor_.next(options_.local_time());
    const Playlist& list = *cursor_.list();
    if (item.item.source.kind != SourceKind::Ring || pick.kind != NextItem::Kind::Item ||
        list.items[pick.index].source != item.item.source || playing_.outdated || next_.item)
      return false;
    item.item = list.items[pick.index];
    put_at(item, {cursor_.list(), pick.index, pick.rounds_done});
    cursor_.choose(pick.index, pick.rounds_done);
    return true;
  }
  void wait_for_renderer(OpenItem& item, bool waits) {
    const std::lock_guard lock(mutex_);
    item.waits_for_renderer = playing_.waits_for_renderer = waits;
  }
  void note_first_frame(const OpenItem& item) {
    const std::lock_guard lock(mutex_);
    shown_ = playing_.has_shown = true;
    faults_.broke_off = false;
    if (item.index) faults_.unplayable_in_a_row = 0;
  }
  /// An item that cannot be played, or not any further.
  struct Fault {
    std::string source;
    std::string why;
    bool standby = false;
    bool played = false;      ///< frames of it were played
    uint64_t loops_done = 0;  ///< loops of it that were played
  };
  /// Counts and reports an item that is left out.
  void skip(const Fault& fault) {
    const std::string problem = problem_of(fault.source, fault.why);
    {
      const std::lock_guard lock(mutex_);
      if (!faults_.broke_off && faults_.unplayable_in_a_row == 0)
        faults_.since = SteadyClock::now();
      faults_.broke_off = true;
      faults_.loops_done = fault.loops_done;
      if (!fault.played) locked_note_unplayable(fault.standby, problem);
      if (locked_keeps_trying()) next_.list_over = false;
    }
    reporter_.report({.kind = EventKind::ItemSkipped, .source = fault.source, .detail = problem});
  }
  void close(std::unique_ptr<OpenItem> item) {
    const std::lock_guard lock(mutex_);
    trash_.push_back(std::move(item));
    work_there_.notify_all();
  }
  [[nodiscard]] uint64_t loops_of(const OpenItem& item) const {
    const std::lock_guard lock(mutex_);
    const std::vector<PlaylistItem>& items = cursor_.list()->items;
    return items.size() == 1 && item.index ? items.front().loops : item.item.loops;
  }
  /// Returns true if the list was replaced by one that does not continue the playing item.
  [[nodiscard]] bool is_outdated() const {
    const std::lock_guard lock(mutex_);
    return playing_.outdated;
  }
  /// Returns the item of that number with its new files; null if they were not replaced.
  [[nodiscard]] std::unique_ptr<OpenItem> take_replacement(uint32_t number) {
    const std::lock_guard lock(mutex_);
    return playing_.number == number ? std::move(playing_.replacement) : nullptr;
  }

  // The target of a jump. Thread safety: the frame copier.
  struct Arrival {
    std::unique_ptr<OpenItem> item;
    uint64_t serial = 0;
    std::chrono::steady_clock::time_point since{};  ///< time of the request
  };
  /// Returns the target if it is open; its first frame is still to come.
  [[nodiscard]] std::optional<Arrival> take_arrival() {
    const std::lock_guard lock(mutex_);
    if (!jump_.request || !jump_.request->item) return std::nullopt;
    JumpRequest& request = *jump_.request;
    return Arrival{
        .item = std::move(request.item), .serial = request.serial, .since = request.since};
  }
  void put_back(Arrival arrival) {
    const std::lock_guard lock(mutex_);
    if (jump_.holds(arrival.serial)) jump_.request->item = std::move(arrival.item);
    locked_discard(arrival.item);
    work_there_.notify_all();
  }
  /// Moves the list to the target, and returns the function to call then. Null if another jump was
  /// requested meanwhile. `leaving` is the progress of the playing item.
  [[nodiscard]] JumpDone accept(uint64_t serial, const ItemProgress& leaving) {
    const std::lock_guard lock(mutex_);
    if (!jump_.holds(serial)) return nullptr;
    const JumpRequest& request = *jump_.request;
    if (request.place.interrupts && !cursor_.interrupted()) interrupted_ = leaving;
    // A second interruption: later, the panel may no longer know the first one's predecessor.
    if (request.place.interrupts) (void)locked_find_progress();
    if (!request.returns) cursor_.jump(request.place);  // begin() returns
    if (!cursor_.interrupted()) interrupted_ = {};
    next_.list_over = next_.nothing_for_now = next_.requested = false;
    jumped_ = true;
    ++jump_.serial;  // discards the item being opened for the old place
    locked_discard(next_.item);
    return jump_.end();
  }
  void fail(Arrival arrival, const Error& error) {
    PlaylistEvent skipped = skipped_by_jump(arrival.item->item, error);
    close(std::move(arrival.item));
    JumpDone done;
    {
      const std::lock_guard lock(mutex_);
      if (!jump_.holds(arrival.serial)) return;
      if (!jump_.request->passes_on()) done = jump_.end();
      next_.requested = true;
      work_there_.notify_all();
    }
    done ? done(&error) : reporter_.report(std::move(skipped));
  }

  // Thread safety: any thread.
  void jump(const Jump& jump, const JumpDone& done) {
    put_request(jump_, done, [&] {
      Jump where = jump;
      // The panel may still show the item from which the last jump left.
      if (where.displayed && where.displayed->number < jumped_to_) where.displayed.reset();
      return JumpRequest{.place = cursor_.target_of(where),
                         .frame = where.frame,
                         .step = where.relative ? static_cast<int>(where.item.value_or(0)) : 0};
    });
  }
  /// Ends an interruption at once. Fails if nothing is interrupted.
  void return_now(const JumpDone& done) {
    bool is_done = false;
    put_request(jump_, done, [&]() -> std::optional<JumpRequest> {
      const auto& place = cursor_.interrupted();
      if (!place)
        throw Error(ErrorKind::Failed, "back: nothing is interrupted",
                    "'interrupt' and 'blank' begin an interruption");
      is_done = !place->playing;
      if (!is_done)
        return JumpRequest{.place = {.list = place->list,
                                     .index = *place->playing,
                                     .rounds_done = place->rounds_done},
                           .returns = true};
      locked_leave_interruption();
      return std::nullopt;
    });
    if (is_done) done(nullptr);
  }
  /// Opens the target of a jump and decodes its first frames. `done` is called when that is done.
  /// The list does not end while an item is cued.
  void cue(const Jump& jump, const JumpDone& done) {
    put_request(cue_, done, [&] {
      return JumpRequest{.place = cursor_.target_of(jump),
                         .frame = jump.frame,
                         .in_present_list = jump.list == nullptr};
    });
  }
  /// Jumps to the cued item. Fails if none is cued, or not completely yet.
  void go(const JumpDone& done) {
    put_request(jump_, done, [&] {
      if (!cue_.request)
        throw Error(ErrorKind::Failed, "go: no item is cued", "cue one first: cue SOURCE");
      if (!cue_.request->decoded)
        throw Error(ErrorKind::Failed, "go: the cued item is not decoded yet",
                    "wait for the answer to 'cue'");
      if (cue_.request->in_present_list && !locked_follow_list(*cue_.request))
        throw Error(ErrorKind::Failed, "go: the list was replaced and lacks the cued item",
                    "cue an item of the new list");
      JumpRequest request = *std::exchange(cue_.request, std::nullopt);
      put_at(*request.item, request.place);
      return request;
    });
  }
  /// Adds what the loader knows to the status: jump, cue, interruption and state.
  void complete(PlaylistStatus& status) const {
    const std::lock_guard lock(mutex_);
    const auto& place = cursor_.interrupted();
    const auto source_at = [](const auto& list, size_t index) {
      return list->items[index].source.text;
    };
    status.opening = jump_.request.has_value();
    if (cue_.request) status.cued = source_at(cue_.request->place.list, cue_.request->place.index);
    if (place)
      status.interrupted =
          place->playing ? source_at(place->list, *place->playing) : place->list->name;
    const bool plays = playing_.number != 0 && !playing_.standby;
    const bool is_ring = playing_.item.source.kind == SourceKind::Ring;
    if (next_.list_over && playing_.number == 0) status.rounds_done = next_.rounds_done;
    if (plays && (playing_.waits_for_renderer || (is_ring && !playing_.has_shown)))
      status.state = kNoRenderer;
    else if (plays && place && playing_.item.source.kind == SourceKind::Black)
      status.state = {"blank", "until 'back'"};
    else if (plays && playing_.has_shown)  // though the items after it may not
      status.state = {};
    else if (next_.list_over && cue_.request)
      status.state = {"cued", status.cued + " waits for 'go'"};
  }
  void set_loops(uint64_t loops) {
    const std::lock_guard lock(mutex_);
    cursor_.set_loops(loops);
    next_.list_over = false;
    work_there_.notify_all();
  }
  void hold(bool held) {
    const std::lock_guard lock(mutex_);
    held_ = held;
    wake_.signal();
  }
  void look_again() {
    const std::lock_guard lock(mutex_);
    checks_.at_once = true;
    work_there_.notify_all();
  }
  /// Returns the list that is played, or that continues after the present interruption.
  [[nodiscard]] std::shared_ptr<const Playlist> list() const {
    const std::lock_guard lock(mutex_);
    return cursor_.interrupted() ? cursor_.interrupted()->list : cursor_.list();
  }

 private:
  using EventKind = PlaylistEvent::Kind;
  using SteadyClock = std::chrono::steady_clock;
  /// Pause before another attempt when no item can be played or none is scheduled.
  static constexpr auto kRetry = std::chrono::seconds(1);
  /// Time between two checks of the files. A new state must be seen twice in a row, because the
  /// file may still be being written.
  static constexpr auto kCheck = std::chrono::seconds(1);
  /// Pause in which the loader reads a list again before it tries the list's next item.
  static constexpr auto kAfterCheck = std::chrono::milliseconds(20);
  /// Pause before the loader looks again for something that takes a few frames.
  static constexpr auto kSoon = std::chrono::milliseconds(10);
  /// Time after which a test card replaces the last frame of items that cannot be played any more.
  static constexpr auto kUntilCard = std::chrono::seconds(10);
  /// Time after which the panel is not expected to show the first frame of an interruption.
  static constexpr auto kLongestFlip = std::chrono::milliseconds(500);
  static constexpr auto kLongestDecoding = std::chrono::seconds(30);

  /// Does work without the lock.
  template <class Work>
  static auto unlocked(std::unique_lock<std::mutex>& lock, Work&& work) {
    struct Relock {
      std::unique_lock<std::mutex>& lock;
      ~Relock() { lock.lock(); }
    } relock{lock};
    lock.unlock();
    return work();
  }

  static PlaylistItem card_for(const PlayState& state) {
    return {.source = parse_source("card"), .rate = frames::Rate{4, 1}, .shown = state};
  }

  static PlaylistItem black_item() {
    // Often enough that an item need not wait long for its end.
    return {.source = parse_source("black"), .loops = kForever, .rate = frames::Rate{4, 1}};
  }

  /// Returns the frame at which an item is opened to continue. What comes in live has no earlier
  /// frames.
  static uint64_t opening_frame(const PlaylistItem& item, uint64_t frame) {
    const SourceKind kind = item.source.kind;
    return kind == SourceKind::Ring || kind == SourceKind::Live ? 0 : frame;
  }

  static std::string files_to_play(size_t files) {
    return files == 0   ? "its files are gone"
           : files == 1 ? "1 file to play"
                        : fmt::format("{} files to play", files);
  }

  static std::string problem_of(const std::string& source, const std::string& why) {
    return why.starts_with(source) ? why : source + ": " + why;
  }
  static PlaylistEvent skipped_by_jump(const PlaylistItem& item, const Error& error) {
    const std::string& source = item.source.text;
    return {.kind = EventKind::ItemSkipped,
            .source = source,
            .detail = problem_of(source, with_remedy(error))};
  }

  static void put_at(OpenItem& item, const PlaylistPlace& place) {
    item.list = place.list;
    item.index = place.index;
    item.rounds_done = place.rounds_done;
    item.interrupts = place.interrupts;
  }
  using SteadyTime = std::chrono::steady_clock::time_point;
  using Lock = std::unique_lock<std::mutex>;

  /// The item that follows the playing one.
  struct Next {
    std::unique_ptr<OpenItem> item{};
    bool requested = false;
    bool list_over = false;        ///< the last round is over
    int64_t rounds_done = 0;       ///< then
    bool nothing_for_now = false;  ///< no item is scheduled now
    SteadyTime retry_at{};
    [[nodiscard]] bool is_due() const { return requested && !item && !list_over; }
  };

  struct JumpRequest {
    PlaylistPlace place{};
    uint64_t frame = 0;
    int step = 0;                  ///< 1 or -1: to the next or the previous item that can be played
    size_t passed = 0;             ///< number of items on the way that cannot be played
    bool returns = false;          ///< to the interrupted item
    bool in_present_list = false;  ///< names an item of the list that is played
    uint64_t serial = 0;
    JumpDone done{};
    SteadyTime since{};
    bool opened = false;   ///< opening has begun
    bool decoded = false;  ///< cue: the first frames are decoded
    /// Null until it is open, and while the frame copier tries it.
    std::unique_ptr<OpenItem> item{};

    /// Passes over an item that cannot be played. Returns false if no other is left.
    bool passes_on() {
      if (step == 0 || ++passed + 1 >= place.list->items.size()) return false;
      const ListPlace next = place.list->beside({place.index, place.rounds_done}, step);
      place.index = next.index;
      place.rounds_done = next.round;
      opened = false;
      since = SteadyClock::now();
      return true;
    }
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
    bool waits_for_renderer = false, has_shown = false;
    int64_t rounds_done = 0;
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
    std::string problem{};           ///< reason why the first of these cannot be played
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
  void work() {
    Lock lock(mutex_);
    while (!stopping_) {
      const SteadyTime now = SteadyClock::now();
      if (!trash_.empty())
        empty_trash(lock);
      else if (jump_.is_to_open() && now >= jump_.due)
        open_target(lock, jump_);
      else if (cue_.is_to_open())
        open_target(lock, cue_);
      else if (cue_.is_to_decode() && now >= cue_.due)
        look_at_cued(lock);
      else if (next_.is_due() && now >= next_.retry_at)
        open_next(lock);
      else if (is_time_to_check())
        check_files(lock);
      else
        work_there_.wait_until(lock, next_step());
    }
  }
  /// Returns the time at which the loader looks for work without being woken.
  [[nodiscard]] SteadyTime next_step() const {
    const SteadyTime now = SteadyClock::now();
    SteadyTime next = now + kRetry;
    if (jump_.is_to_open()) next = std::min(next, jump_.due);
    if (cue_.is_to_decode()) next = std::min(next, cue_.due);
    if (next_.is_due()) next = std::min(next, next_.retry_at);
    return std::max(next, now);
  }
  void empty_trash(Lock& lock) {
    std::vector<std::unique_ptr<OpenItem>> trash = std::exchange(trash_, {});
    unlocked(lock, [&] { trash.clear(); });
  }
  void open_next(Lock& lock) {
    const auto list = cursor_.list();
    const uint64_t serial = jump_.serial;
    const auto is_unwanted = [&] { return serial != jump_.serial || list != cursor_.list(); };
    const LocalTime now = options_.local_time();
    NextItem pick = cursor_.next(now);
    if (pick.kind == NextItem::Kind::End && cursor_.interrupted()) return open_interrupted(lock);
    const bool again = locked_keeps_trying();
    if (pick.kind == NextItem::Kind::End && again)
      pick = {.kind = NextItem::Kind::Item, .index = 0, .rounds_done = cursor_.rounds_done()};
    next_.nothing_for_now = pick.kind == NextItem::Kind::None;
    next_.list_over = pick.kind == NextItem::Kind::End;
    next_.rounds_done = pick.rounds_done;
    const PlayState why = next_.list_over && shown_ ? PlayState() : locked_state(now);
    const bool is_news = !why.plays() && reporter_.note_waiting(why);
    if (next_.list_over) return wake_.signal();
    if (is_news) {
      unlocked(lock, [&] {
        reporter_.report({.kind = EventKind::Waiting, .source = list->name, .detail = why.reason});
      });
      if (is_unwanted()) return;
    }
    std::optional<PlaylistItem> standby;
    if (next_.nothing_for_now || locked_none_works()) standby = locked_standby_to_open();
    if (next_.nothing_for_now && !standby) {
      locked_pause();
      return wake_.signal();
    }
    if (standby) pick.kind = NextItem::Kind::None;
    const PlaylistItem item = standby ? *standby : list->items[pick.index];
    if (again && list->items.size() == 1 && !standby &&
        unlocked(lock, [&] { return is_changing(item); })) {
      faults_.since = SteadyClock::now();
      return locked_pause();
    }
    // A ring that plays takes its next turn itself.
    const bool is_open =
        item.source.kind == SourceKind::Ring && item.source == playing_.item.source;
    if (is_open && playing_.number != 0) {
      next_.requested = false;
      return;
    }
    bool list_is_old = false;
    Attempt attempt = unlocked(lock, [&] {
      Attempt opened = try_open(item, 0, list.get());
      // A file that was removed from a folder is no fault: the list is read again first.
      list_is_old = !opened.item && is_list_changed(*list);
      return opened;
    });
    if (is_unwanted()) return locked_discard(attempt.item);
    if (attempt.item && again && !standby) {
      attempt.item->loops_done = faults_.loops_done;
      faults_.files.clear();  // if it breaks again, a pause comes first
    }
    if (attempt.item) return locked_offer(std::move(attempt.item), pick);
    if (list_is_old) {
      checks_.at_once = true;
      next_.retry_at = SteadyClock::now() + kAfterCheck;
      return;
    }
    if (!standby) cursor_.choose(pick.index, pick.rounds_done);
    const Fault fault{.source = item.source.text,
                      .why = with_remedy(*attempt.error),
                      .standby = standby.has_value(),
                      .loops_done = again ? faults_.loops_done : 0};
    unlocked(lock, [&] { skip(fault); });
  }
  /// Opens the target of a jump, or a cued item. At most two items are open beside the displayed
  /// one, so a jump closes the item that was to be next.
  void open_target(Lock& lock, JumpSlot& slot) {
    if (slot.request->returns && !locked_find_progress(slot.request->since + kLongestFlip)) {
      slot.due = SteadyClock::now() + kSoon;
      return;
    }
    slot.request->opened = true;
    const uint64_t serial = slot.request->serial;
    const PlaylistPlace place = slot.request->place;
    const PlaylistItem& item = place.list->items[place.index];
    const uint64_t frame =
        slot.request->returns ? opening_frame(item, interrupted_.frame) : slot.request->frame;
    const bool jumps = &slot == &jump_;
    std::unique_ptr<OpenItem> gone = jumps ? std::move(next_.item) : nullptr;
    const bool next_was_requested = next_.requested || gone;
    if (jumps) next_.requested = false;
    // The items that could not be played before `gone` are tried again after the playing one.
    if (gone && cursor_.back_to_playing()) faults_.unplayable_in_a_row = 0;
    Attempt attempt = unlocked(lock, [&] {
      gone.reset();
      return try_open(item, frame);
    });
    if (!slot.holds(serial)) return locked_discard(attempt.item);
    if (attempt.item) {
      put_at(*attempt.item, place);
      if (slot.request->returns) continue_item(*attempt.item, interrupted_);
      slot.request->item = std::move(attempt.item);
      return wake_.signal();
    }
    const bool returns = slot.request->returns;
    if (jumps) next_.requested = next_was_requested;
    if (slot.request->passes_on())
      return unlocked(lock, [&] { reporter_.report(skipped_by_jump(item, *attempt.error)); });
    const JumpDone done = slot.end();
    if (returns) {
      const Fault fault{.source = item.source.text, .why = with_remedy(*attempt.error)};
      locked_leave_interruption();
      return unlocked(lock, [&] {
        skip(fault);
        done(nullptr);
      });
    }
    unlocked(lock, [&] {
      done(&*attempt.error);
      wake_.signal();
    });
  }
  /// Opens the interrupted item ahead of the end of the interruption. begin() then returns to its
  /// list.
  void open_interrupted(Lock& lock) {
    const InterruptedPlace place = *cursor_.interrupted();
    if (!place.playing) return locked_end_interruption();
    if (!locked_find_progress()) {
      next_.retry_at = SteadyClock::now() + kSoon;
      return;
    }
    const uint64_t serial = jump_.serial;
    const auto list = cursor_.list();
    const PlaylistItem& item = place.list->items[*place.playing];
    const uint64_t frame = opening_frame(item, interrupted_.frame);
    Attempt attempt = unlocked(lock, [&] { return try_open(item, frame); });
    if (serial != jump_.serial || list != cursor_.list()) return locked_discard(attempt.item);
    if (attempt.item) {
      put_at(*attempt.item,
             {.list = place.list, .index = *place.playing, .rounds_done = place.rounds_done});
      continue_item(*attempt.item, interrupted_);
      next_.item = std::move(attempt.item);
      next_.requested = false;
      return wake_.signal();
    }
    locked_end_interruption();
    const Fault fault{.source = item.source.text, .why = with_remedy(*attempt.error)};
    unlocked(lock, [&] { skip(fault); });
  }
  /// Reports a cued item as soon as frames of it are decoded. Its source decodes on threads of its
  /// own.
  void look_at_cued(Lock& lock) {
    JumpRequest& cued = *cue_.request;
    frames::FrameSource& source = *cued.item->opened.source;
    source.service();
    cue_.due = SteadyClock::now() + kSoon;
    cued.decoded = source.saturated() || source.ready_count() > 0;
    const bool gives_up = !cued.decoded && SteadyClock::now() - cued.since > kLongestDecoding;
    if (!cued.decoded && !gives_up) return;
    const JumpDone done = std::exchange(cued.done, nullptr);
    const Error error(ErrorKind::Input, cued.item->item.source.text + ": no frame arrived");
    if (gives_up) {
      locked_discard(cued.item);
      cue_.request.reset();
    }
    unlocked(lock, [&] { done(gives_up ? &error : nullptr); });
  }
  [[nodiscard]] bool is_time_to_check() const {
    const bool follows = options_.marks_of || options_.read_list;
    return follows && !ended_ && (checks_.at_once || SteadyClock::now() >= checks_.due);
  }
  void check_files(Lock& lock) {
    checks_.due = SteadyClock::now() + kCheck;
    check_list(lock, std::exchange(checks_.at_once, false));
    check_item(lock);
  }
  /// Reads the list if its file was replaced. A list that cannot be read is not tried again until
  /// its file changes.
  void check_list(Lock& lock, bool at_once) {
    const auto list = cursor_.list();
    if (!options_.read_list || !list->file) return;
    const FileMark now = unlocked(lock, [&] { return mark_of_list(list->name); });
    const bool steady = std::exchange(checks_.list_seen, now) == now;
    const bool is_new = now != *list->file;
    if (list != cursor_.list() || !(at_once || (is_new && steady))) return;
    std::optional<Playlist> read;
    std::string why;
    unlocked(lock, [&] {
      try {
        read = options_.read_list(list->name);
      } catch (const std::exception& error) {
        why = error.what();
      }
    });
    if (list != cursor_.list()) return;
    if (!read) {
      cursor_.keep_list(now);
      return unlocked(lock, [&] {
        reporter_.report({.kind = EventKind::Kept, .source = list->name, .detail = why});
      });
    }
    PlaylistEvent replaced{.kind = EventKind::Replaced, .source = list->name};
    if (names_folder(list->name)) replaced.detail = files_to_play(read->items.size());
    locked_take_list(*std::move(read));
    unlocked(lock, [&] { reporter_.report(replaced); });
  }
  /// Opens the item again if its files were replaced. Not needed when the next item is already
  /// being opened.
  void check_item(Lock& lock) {
    const uint32_t number = playing_.number;
    const bool is_leaving = next_.item || next_.requested || jump_.request || playing_.outdated;
    if (!options_.marks_of || number == 0 || is_leaving || playing_.files.empty()) return;
    const PlaylistItem item = playing_.item;
    const std::vector<FileMark> now = unlocked(lock, [&] { return options_.marks_of(item); });
    if (playing_.number != number) return;
    const bool steady = std::exchange(playing_.seen, now) == now;
    if (!steady || now == playing_.files) return;
    playing_.files = now;
    Attempt attempt = unlocked(lock, [&] {
      Attempt opened = try_open(item, 0);
      if (opened.error)
        reporter_.report({.kind = EventKind::Kept,
                          .source = item.source.text,
                          .detail = with_remedy(*opened.error)});
      return opened;
    });
    if (!attempt.item) return;
    if (playing_.number != number) return locked_discard(attempt.item);
    attempt.item->list = cursor_.list();
    attempt.item->index = cursor_.playing();
    attempt.item->rounds_done = playing_.rounds_done;
    locked_discard(playing_.replacement);
    playing_.replacement = std::move(attempt.item);
  }

  // Any thread. `locked_`: the caller holds the mutex.
  [[nodiscard]] std::unique_ptr<OpenItem> open_item(const PlaylistItem& item,
                                                    uint64_t frame) const {
    auto open = std::make_unique<OpenItem>();
    open->item = item;
    open->first_frame = open->began_at = frame;
    open->skips_to_first = frame > 0;
    if (options_.marks_of) open->files = options_.marks_of(item);
    open->opened = options_.open(item, frame);
    const std::string& name = item.source.text;
    const frames::FrameSource& source = *open->opened.source;
    const frames::FrameGeometry size = source.geometry();
    if (size != options_.panel)
      throw input_error("{}: frames of {}x{} pixels, but the panel has {}x{}", name, size.width,
                        size.height, options_.panel.width, options_.panel.height)
          .remedy("woven frames fit one panel, pixel for pixel");
    if (source.frame_count() && frame >= *source.frame_count())
      throw no_such_frame(item, frame, *source.frame_count());
    if (!item.overlays.empty())
      open->overlays = std::make_unique<OverlaySet>(
          item.overlays, options_.overlaid_panels(), [this](const Error& error) {
            reporter_.report({.kind = EventKind::BadOverlay, .detail = with_remedy(error)});
          });
    return open;
  }
  /// Opens an item that follows another one of `list` (null: by a jump).
  [[nodiscard]] Attempt try_open(const PlaylistItem& item, uint64_t frame,
                                 const Playlist* list = nullptr) const {
    try {
      Attempt opened{.item = open_item(item, frame)};
      if (list != nullptr && list->transition_to(item) != TransitionKind::Cut)
        opened.item->transition = make_transition(*list, item);
      return opened;
    } catch (const Error& error) {
      return {.error = error};
    } catch (const std::exception& error) {
      return {.error = Error(ErrorKind::Failed, item.source.text + ": " + error.what())};
    }
  }
  /// Returns null, so that the item follows by a cut, if memory is short.
  [[nodiscard]] std::unique_ptr<Transition> make_transition(const Playlist& list,
                                                            const PlaylistItem& item) const {
    try {
      return std::make_unique<Transition>(list, item, options_.panel);
    } catch (const std::bad_alloc&) {
      return nullptr;
    }
  }
  void locked_offer(std::unique_ptr<OpenItem> item, const NextItem& pick) {
    item->list = cursor_.list();
    item->interrupts = cursor_.interrupted().has_value();
    if (pick.kind == NextItem::Kind::Item) {
      item->index = pick.index;
      cursor_.choose(pick.index, pick.rounds_done);
    }
    item->rounds_done = cursor_.rounds_done();
    next_.item = std::move(item);
    next_.requested = false;
    wake_.signal();
  }
  void locked_discard(std::unique_ptr<OpenItem>& item) {
    if (item) trash_.push_back(std::move(item));
  }
  /// Returns true if each item that is scheduled now was tried in vain.
  [[nodiscard]] bool locked_none_works() const {
    const size_t scheduled = cursor_.list()->items_scheduled(options_.local_time());
    // One that has begun may still deliver its first frame.
    const size_t rounds = playing_.number != 0 && !playing_.standby && !playing_.has_shown ? 2 : 1;
    return scheduled > 0 && faults_.unplayable_in_a_row >= rounds * scheduled;
  }
  /// Returns true if nothing works any more, and this does not end the list.
  [[nodiscard]] bool locked_keeps_trying() const {
    const bool repeats = options_.outlasts_faults || cursor_.list()->rounds != 1;
    const bool is_last = faults_.broke_off && cursor_.list()->items.size() == 1;
    return repeats && shown_ && !cursor_.interrupted() && (is_last || locked_none_works());
  }
  /// Returns true until two checks in a row find the files of an item unchanged.
  [[nodiscard]] bool is_changing(const PlaylistItem& item) {
    if (!options_.marks_of) return false;
    std::vector<FileMark> now = options_.marks_of(item);
    return std::exchange(faults_.files, now) != now;
  }
  /// Returns the item for times without one of the list: the default, otherwise black for as long
  /// as the panel has no frame, and a test card after a while. None: the last frame stays.
  [[nodiscard]] std::optional<PlaylistItem> locked_standby() const {
    const Playlist& list = *cursor_.list();
    if (list.standby && !faults_.standby_broken) return list.standby;
    if (list.awaits_files || !shown_) return black_item();
    if (locked_none_works() && locked_keeps_trying() &&
        SteadyClock::now() >= faults_.since + kUntilCard)
      return card_for(locked_state(options_.local_time()));
    return std::nullopt;
  }
  /// Returns the same; none if it plays already.
  [[nodiscard]] std::optional<PlaylistItem> locked_standby_to_open() const {
    auto standby = locked_standby();
    return playing_.standby && standby == playing_.item ? std::nullopt : std::move(standby);
  }
  /// Delays the next attempt when no item can be played or none is scheduled.
  void locked_pause() {
    next_.retry_at = SteadyClock::now() + kRetry;
    faults_.standby_broken = false;
  }
  /// Returns why no item of the list can begin.
  [[nodiscard]] PlayState locked_state(LocalTime now) const {
    const Playlist& list = *cursor_.list();
    if (!locked_none_works()) {
      const std::string why = reason_to_wait(list, now);
      return why.empty() ? PlayState() : PlayState{"waiting", why};
    }
    const size_t scheduled = list.items_scheduled(now);
    const bool live = std::ranges::all_of(list.items, [now](const PlaylistItem& item) {
      return item.source.kind == SourceKind::Live || !item.permitted(now);
    });
    return {live ? "no-signal" : "failed",
            scheduled == 1
                ? faults_.problem
                : fmt::format("none of {} items can be played: {}", scheduled, faults_.problem)};
  }
  void locked_note_unplayable(bool standby, const std::string& problem) {
    if (standby && cursor_.list()->standby && !faults_.standby_broken) {
      faults_.standby_broken = true;
    } else if (standby) {  // black
      shown_ = true;
      locked_pause();
    } else {
      if (faults_.unplayable_in_a_row == 0) faults_.problem = problem;
      ++faults_.unplayable_in_a_row;
      if (locked_none_works() && !locked_standby_to_open()) locked_pause();
    }
  }
  [[nodiscard]] FileMark mark_of_list(const std::string& name) const {
    return options_.mark_list ? options_.mark_list(name) : mark_of(name);
  }
  [[nodiscard]] bool is_list_changed(const Playlist& list) const {
    return options_.read_list && list.file && mark_of_list(list.name) != *list.file;
  }
  /// Replaces the list. An item that the new list does not contain ends with its round.
  void locked_take_list(Playlist list) {
    const auto taken = std::make_shared<const Playlist>(std::move(list));
    const bool plays_item = playing_.number != 0 && !playing_.standby;
    const bool continues = cursor_.replace_list(taken, plays_item ? &playing_.item : nullptr);
    faults_.standby_broken = faults_.broke_off = false;
    faults_.unplayable_in_a_row = 0;
    playing_.outdated =
        plays_item ? !continues : playing_.standby && locked_standby() != playing_.item;
    next_.requested = next_.requested || next_.item;
    locked_discard(next_.item);
    next_.list_over = next_.nothing_for_now = false;
    next_.retry_at = {};
    reporter_.take_list(taken->items.size(), cursor_.playing());
    wake_.signal();
  }
  /// Puts the request that `locked_make` returns into the slot, and fails the one that it replaces.
  /// An exception of `locked_make` fails the new one. None: nothing is requested.
  void put_request(JumpSlot& slot, const JumpDone& done,
                   const std::function<std::optional<JumpRequest>()>& locked_make) {
    JumpDone replaced;
    try {
      const std::lock_guard lock(mutex_);
      if (ended_)
        throw Error(ErrorKind::Failed, "control: playback is about to end", "pause it earlier");
      std::optional<JumpRequest> request = locked_make();
      if (request) {
        if (slot.request) {
          locked_discard(slot.request->item);
          replaced = slot.end();
        }
        request->serial = ++slot.serial;
        request->done = done;
        request->since = SteadyClock::now();
        slot.due = {};
        slot.request = std::move(request);
      }
    } catch (const Error& error) {
      return done(&error);
    }
    work_there_.notify_all();
    wake_.signal();
    const char* const name = &slot == &cue_ ? "cue" : "load";
    const Error superseded(
        ErrorKind::Failed,
        fmt::format("{}: replaced by a later {} before it was ready", name, name));
    if (replaced) replaced(&superseded);
  }
  /// Finds the progress of the interrupted item once the panel shows another item, or at `give_up`:
  /// a panel that is off or away shows none. Returns false until then.
  [[nodiscard]] bool locked_find_progress(SteadyTime give_up = SteadyTime::max()) {
    if (interrupted_.final || interrupted_.number == 0) return true;
    LeftItem left;
    if (options_.left_item)
      left = options_.left_item(interrupted_.number);
    else if (interrupted_.given > 0)
      left.last = {.index = interrupted_.given - 1, .number = interrupted_.frame};
    if (left.still_displayed && SteadyClock::now() < give_up) return false;
    interrupted_ = progress_at(interrupted_, left);
    return true;
  }
  void locked_end_interruption() {
    cursor_.end_interruption();
    interrupted_ = {};
  }
  /// Ends the interruption without its predecessor: the list, which may have changed meanwhile,
  /// goes on with its next item that plays, or with its card.
  void locked_leave_interruption() {
    locked_end_interruption();
    playing_.outdated = next_.requested = checks_.at_once = true;
    locked_discard(next_.item);
    wake_.signal();
  }
  /// Finds the item in the list that is played now. Returns false if that list does not have it.
  [[nodiscard]] bool locked_follow_list(JumpRequest& cue) const {
    const auto& list = cursor_.interrupted() ? cursor_.interrupted()->list : cursor_.list();
    if (list == cue.place.list) return true;
    const PlaylistItem& item = cue.item->item;
    const auto& items = list->items;
    const auto same = cue.place.index < items.size() && items[cue.place.index] == item
                          ? items.begin() + static_cast<ptrdiff_t>(cue.place.index)
                          : std::find(items.begin(), items.end(), item);
    if (same == items.end()) return false;
    cue.place.list = list;
    cue.place.index = static_cast<size_t>(same - items.begin());
    return true;
  }

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
  bool jumped_ = false;     ///< the next item is the target of a jump
  uint32_t jumped_to_ = 0;  ///< running number of the last such item
  bool ended_ = false;      ///< the frame copier was told that the list is over
  bool stopping_ = false;

  std::thread thread_;  // last member: the thread uses everything above
};

}  // namespace lenticule::player
