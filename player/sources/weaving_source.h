// SPDX-License-Identifier: Apache-2.0
// WeavingPipeline weaves views into a rig's woven frames; WeavingSource does that during playback.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/unique_fd.h"
#include "frames/frame_source.h"
#include "frames/views_input/view_input.h"
#include "frames/weaving/crosstalk.h"
#include "frames/weaving/fast_weaver.h"
#include "player/sources/live_rig.h"

namespace lenticule::player {

/// The flags of play, weave and convert that state how views are woven.
struct WeavingFlags {
  std::string filter;  ///< empty: the choice of frames::view_filter()
  std::string fit = "contain";
  std::string crosstalk;
};

/// Returns the weave options. Throws Error(Usage) for unknown values.
[[nodiscard]] frames::WeaveOptions weave_options(const WeavingFlags& flags);

/// Parses the value of --crosstalk: empty, "spot", or a percentage. Throws Error(Usage).
[[nodiscard]] std::optional<frames::Crosstalk> crosstalk_of(const std::string& text,
                                                            const optics::Rig& rig, int views);

/// Holds the plan, the threads and the crosstalk compensation. Thread safety: one caller at a time.
class WeavingPipeline {
 public:
  /// Makes the plan, which takes a fraction of a second for a 4K panel. Throws Error(Usage) for
  /// more views than a plan can hold and for invalid flags.
  WeavingPipeline(const optics::Rig& rig, const frames::ViewShape& shape, const WeavingFlags& flags,
                  int threads);

  /// Weaves views of that shape into a frame of the panel's size. Throws only with crosstalk
  /// compensation: Error(Usage) for too many views, std::bad_alloc.
  void weave(const frames::ViewSet& views, frames::WovenFrame& frame);

 private:
  frames::FastWeaver weaver_;
  std::optional<frames::Crosstalk> crosstalk_;
};

struct WeavingSourceOptions {
  std::string name = {};                   ///< name in messages
  std::shared_ptr<LiveRig> rig = nullptr;  ///< must not be null
  WeavingFlags weaving = {};
  int threads = 1;
  int pool_frames = 8;  ///< woven frames kept ready, at least 3
  /// Weaves on into the next round, so that rewind() is immediate.
  bool plays_again = true;
};

/// WeavingSource weaves views from any input during playback. When the rig file or its trim
/// changes, it makes a new plan in the background and uses the old one until the new one is ready.
/// An input with one frame is a still and is woven again when the plan changes. Thread safety: the
/// player's calls come from one thread; they take a lock that is never held during work.
class WeavingSource final : public frames::FrameSource {
 public:
  /// Weaves a still's first frame. Throws Error(Input) for the rig and for a still that is missing
  /// or broken, Error(Usage) for more views than a plan can hold.
  WeavingSource(std::unique_ptr<frames::ViewInput> input, const WeavingSourceOptions& options);
  /// Waits for the frame or plan in progress.
  ~WeavingSource() override;
  WeavingSource(const WeavingSource&) = delete;
  WeavingSource& operator=(const WeavingSource&) = delete;

  [[nodiscard]] frames::FrameGeometry geometry() const override { return geometry_; }
  /// Returns the rate; a still is pulled four times a second.
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return rate_; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override;
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override;
  void release(uint64_t token) override;
  [[nodiscard]] int max_acquired() const override;
  [[nodiscard]] uint64_t ready_count() const override;
  [[nodiscard]] bool saturated() const override;
  [[nodiscard]] bool rewind() override;
  [[nodiscard]] int wake_fd() const override { return wake_.fd(); }
  void service() override { wake_.drain(); }
  [[nodiscard]] std::string failure() const override;
  [[nodiscard]] frames::FrameDamage damage() const override { return input_->damage(); }
  [[nodiscard]] std::string video_decoder() const override { return input_->video_decoder(); }

  /// Returns the number of plans made so far.
  [[nodiscard]] uint64_t plans() const { return plans_.load(); }

 private:
  /// A ticket counts frames through all rounds. A still has one frame, which is woven into another
  /// slot when its plan changes.
  enum class SlotState { Free, Weaving, Ready, Acquired, Stale };
  struct Slot {
    SlotState state = SlotState::Free;
    uint64_t ticket = 0;
    uint64_t number = 0;
    int acquired = 0;
    frames::WovenFrame frame;
  };
  void weave_first_still();
  [[nodiscard]] std::shared_ptr<WeavingPipeline> pipeline_for(const optics::Rig& rig) const;
  void watch() noexcept;
  void look_at_rig();
  void work() noexcept;
  [[nodiscard]] std::shared_ptr<WeavingPipeline> newest_pipeline();
  bool weave_still(std::shared_ptr<WeavingPipeline>& used);
  bool weave_next();
  void finish_round();
  [[nodiscard]] Slot* free_slot();
  void give_back(Slot& slot);
  [[nodiscard]] Slot* ready_slot(uint64_t ticket);
  void publish_still(Slot& slot);
  void publish(Slot& slot);
  void fail(const std::string& why);
  void wait_a_moment();

  const WeavingSourceOptions options_;
  const std::unique_ptr<frames::ViewInput> input_;  ///< used by the worker thread
  const bool still_;
  frames::FrameGeometry geometry_;
  const std::optional<frames::Rate> rate_;
  uint64_t rig_version_ = 0;  ///< rig version of the newest plan; used by the watcher thread
  WakeFd wake_;
  std::atomic<uint64_t> plans_{0};
  bool at_end_ = false;  ///< the input is at its end and not rewound; used by the worker thread

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Slot> slots_;
  std::shared_ptr<WeavingPipeline> pipeline_;
  std::optional<uint64_t> count_;    ///< frames in a round, if known
  uint64_t next_weave_ = 0;          ///< ticket
  uint64_t next_pull_ = 0;           ///< ticket
  uint64_t round_begin_ = 0;         ///< first ticket of this round
  std::deque<uint64_t> round_ends_;  ///< tickets before which pull() stops until rewind()
  uint64_t rounds_wanted_ = 1;
  uint64_t rounds_woven_ = 0;
  bool nothing_to_do_ = false;  ///< the input is over, and no other round is requested
  std::string failure_;
  bool stopping_ = false;

  std::thread watcher_, worker_;
};

}  // namespace lenticule::player
