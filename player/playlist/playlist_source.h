// SPDX-License-Identifier: Apache-2.0
// PlaylistSource presents a playlist as one source of frames: it plays item after item, skips items
// that cannot be played, and can jump while it plays.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/unique_fd.h"
#include "frames/frame_source.h"
#include "player/playlist/item_loader.h"

namespace lenticule::player {

/// All frames have the panel's size; an item of another size counts as broken. The source never
/// fails: if no item can be played, it plays the list's default, otherwise the last frame stays,
/// which is black before the first one.
///
/// Thread safety: FrameSource's functions run on one thread, the frame copier; damage() and the
/// functions of the second group run on any. The members belong to the frame copier, except loader_
/// and reporter_, which have locks of their own.
class PlaylistSource final : public frames::FrameSource {
 public:
  /// Throws Error(Failed) if no descriptor is left. Opens no item yet.
  PlaylistSource(std::shared_ptr<const Playlist> list, PlaylistSourceOptions options);
  PlaylistSource(const PlaylistSource&) = delete;
  PlaylistSource& operator=(const PlaylistSource&) = delete;

  /// Opens the only item of a list on the calling thread, so that a list of one unplayable item
  /// fails at once; begins to look for the first item of other lists. Call it before anything is
  /// pulled. Throws the item's error.
  void open_first();
  /// Sets the rate of items without one; call it before anything is pulled.
  void set_display_rate(frames::Rate rate) { display_rate_ = rate; }

  /// Starts a jump. Only one is pending at a time: a new jump replaces a pending one, which then
  /// fails.
  void jump(const Jump& jump, const JumpDone& done) { loader_.jump(jump, done); }
  /// Ends an interruption at once.
  void return_now(const JumpDone& done) { loader_.return_now(done); }
  /// Opens an item that go() shows. `done` is called when its first frames are decoded.
  void cue(const Jump& jump, const JumpDone& done) { loader_.cue(jump, done); }
  void go(const JumpDone& done) { loader_.go(done); }
  /// States the speed at which frames are taken, as a factor, so that items are opened early
  /// enough.
  void set_speed(double factor) { speed_.store(factor); }
  /// Sets the loops of the list, or of its only item; kForever is allowed. Takes effect at the next
  /// loop point.
  void set_loops(uint64_t loops) { loader_.set_loops(loops); }
  /// Prevents the list from ending while `held` is true: it is paused and may jump.
  void hold(bool held) { loader_.hold(held); }
  /// Checks the list and item for replaced files at once, and reads the list even if its file is
  /// the same.
  void look_again() { loader_.look_again(); }
  [[nodiscard]] PlaylistStatus status() const;
  /// Returns the list that is played.
  [[nodiscard]] std::shared_ptr<const Playlist> list() const { return loader_.list(); }
  /// Returns the account of the item's turn, if it is remembered.
  [[nodiscard]] std::optional<ItemAccount> account_of(uint32_t item) const {
    return reporter_.account_of(item);
  }

  [[nodiscard]] frames::FrameGeometry geometry() const override { return options_.panel; }
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return rate_; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return std::nullopt; }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override;
  void release(uint64_t token) override;
  [[nodiscard]] int max_acquired() const override;
  [[nodiscard]] uint64_t ready_count() const override;
  [[nodiscard]] bool saturated() const override;
  [[nodiscard]] bool rewind() override { return false; }
  [[nodiscard]] int wake_fd() const override { return poll_.get(); }
  void service() override;
  [[nodiscard]] std::string failure() const override { return {}; }
  [[nodiscard]] bool nothing_due() const override { return idle_; }
  [[nodiscard]] bool waits_for_others() const override {
    return !current_ || current_->opened.source->waits_for_others();
  }
  [[nodiscard]] uint64_t cut() const override { return cut_; }
  [[nodiscard]] frames::FrameDamage damage() const override { return reporter_.damage(); }

 private:
  struct Acquired {
    uint64_t token = 0;
    uint64_t inner = 0;  ///< token of the item's source
    OpenItem* item = nullptr;
  };

  // Frames.
  [[nodiscard]] frames::PullStatus pull_current(frames::AcquiredFrame& out);
  [[nodiscard]] frames::PullStatus pull_from(OpenItem& item, frames::AcquiredFrame& out);
  [[nodiscard]] frames::PullStatus nothing_yet();
  void hand_out(OpenItem& item, frames::AcquiredFrame& out);

  // Changes of items.
  [[nodiscard]] bool enters_next();
  [[nodiscard]] bool is_over(const OpenItem& item) const;
  [[nodiscard]] bool goes_round(OpenItem& item);
  [[nodiscard]] bool takes_replacement(const OpenItem& item);
  void begin(std::unique_ptr<OpenItem> item);
  void leave_current(bool to_end = true);
  void break_current(const std::string& why);
  void want_next_in_time();
  void watch(const OpenItem& item, bool on) const;
  [[nodiscard]] frames::Rate rate_of(const OpenItem& item) const;

  // Jumps.
  void try_arrival();
  void arrive(ItemLoader::Arrival arrival, frames::AcquiredFrame first);

  const PlaylistSourceOptions options_;
  frames::Rate display_rate_{60, 1};
  WakeFd wake_;
  UniqueFd poll_;  ///< readable when wake_ or the current item's descriptor is

  std::unique_ptr<OpenItem> current_;
  std::vector<std::unique_ptr<OpenItem>> retired_;  ///< items with frames that are still borrowed
  std::vector<Acquired> acquired_;
  std::optional<frames::AcquiredFrame> in_hand_;  ///< first frame after a jump
  std::optional<frames::Rate> rate_;
  uint64_t next_token_ = 1;
  uint32_t next_number_ = 1;
  uint64_t frames_given_ = 0;  ///< frames that pull() has returned
  std::atomic<double> speed_{1.0};
  uint64_t cut_ = 0;
  bool idle_ = false;
  bool at_end_ = false;
  bool next_asked_ = false;
  std::optional<std::chrono::steady_clock::time_point> give_up_at_;  ///< none once an item plays

  PlaylistReporter reporter_;
  ItemLoader loader_;  // last member: its thread uses wake_ and reporter_
};

}  // namespace lenticule::player
