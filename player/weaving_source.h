// SPDX-License-Identifier: Apache-2.0
// Views that are woven while they play: a still quilt, a set of views, or a sequence of quilts.
// When the rig file or its trim changes, a new plan is made in the background; until it is ready,
// frames go on being woven by the old one.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "frames/frame_source.h"
#include "frames/image_sequence.h"
#include "frames/quilt.h"
#include "frames/weaving/fast_weaver.h"
#include "player/rig_watch.h"
#include "player/wake_fd.h"

namespace lenticule::player {

struct QuiltSourceOptions {
  std::string rig_file = {};
  frames::WeaveOptions weave = {};
  int pool_frames = 8;  ///< woven frames kept ready, at least 3
  int decoder_threads = 1;
  int weaving_threads = 1;
  std::optional<frames::Rate> rate = std::nullopt;
};

/// The constructors weave nothing but a still's first frame; they throw Error(Input) for the rig,
/// for pictures that are missing or broken, and for a layout that does not fit, Error(Usage) for
/// more views than a plan takes. The player's calls come from one thread and only take a lock that
/// nobody holds while working.
class QuiltSource final : public frames::FrameSource {
 public:
  QuiltSource(frames::ViewSet still, const QuiltSourceOptions& options);
  QuiltSource(std::vector<std::filesystem::path> quilts, const frames::QuiltLayout& layout,
              const QuiltSourceOptions& options);
  /// Waits for the frame, or the plan, that is being worked on.
  ~QuiltSource() override;
  QuiltSource(const QuiltSource&) = delete;
  QuiltSource& operator=(const QuiltSource&) = delete;

  [[nodiscard]] frames::FrameGeometry geometry() const override { return geometry_; }
  /// A still is looked at four times a second.
  [[nodiscard]] std::optional<frames::Rate> rate() const override;
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return count_; }
  [[nodiscard]] frames::PullStatus pull(frames::LentFrame& out) override;
  void release(uint64_t token) override;
  [[nodiscard]] int max_lent() const override;
  [[nodiscard]] uint64_t ready_count() const override;
  [[nodiscard]] bool saturated() const override;
  [[nodiscard]] bool rewind() override;
  [[nodiscard]] int wake_fd() const override { return wake_.fd(); }
  void service() override { wake_.drain(); }
  [[nodiscard]] std::string failure() const override;

  /// Plans that were made so far.
  [[nodiscard]] uint64_t plans() const { return plans_.load(); }

 private:
  /// Frames count in tickets through all rounds. A still has one frame, which is woven into another
  /// slot when its plan changes.
  enum class SlotState { Free, Weaving, Ready, Lent, Stale };
  struct Slot {
    SlotState state = SlotState::Free;
    uint64_t ticket = 0;
    int lent = 0;
    frames::WovenFrame frame;
  };

  void start(const frames::ViewShape& shape);
  [[nodiscard]] std::shared_ptr<const frames::WeavePlan> plan_for(const optics::Rig& rig) const;
  void watch() noexcept;
  void tell_complaint();
  void work() noexcept;
  [[nodiscard]] std::shared_ptr<frames::FastWeaver> newest_weaver();
  bool weave_still(std::shared_ptr<frames::FastWeaver>& used);
  bool weave_next(const std::shared_ptr<frames::FastWeaver>& weaver);
  [[nodiscard]] Slot* free_slot();
  [[nodiscard]] Slot* ready_slot(uint64_t ticket);
  void publish_still(Slot& slot);
  void fail(const std::string& why);
  void wait_a_moment();
  void wait_for_quilt();

  const QuiltSourceOptions options_;
  std::optional<frames::ViewSet> still_;
  std::unique_ptr<frames::ImageSequence> quilts_;
  frames::QuiltLayout layout_;
  frames::ViewShape shape_;
  frames::FrameGeometry geometry_;
  uint64_t count_ = 1;
  RigWatch rig_;
  std::string told_;  ///< the watcher's
  WakeFd wake_;
  std::atomic<uint64_t> plans_{0};

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Slot> slots_;
  std::shared_ptr<frames::FastWeaver> weaver_;
  uint64_t next_weave_ = 0;  ///< ticket
  uint64_t next_pull_ = 0;   ///< ticket
  uint64_t round_end_ = 0;
  std::string failure_;
  bool stopping_ = false;

  std::thread watcher_, worker_;
};

}  // namespace lenticule::player
