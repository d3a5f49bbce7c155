// SPDX-License-Identifier: Apache-2.0
// StillSource presents one picture in memory, a test card, as a source that never ends.
#pragma once

#include <utility>

#include "frames/frame_source.h"

namespace lenticule::player {

/// Delivers a frame once a second, which satisfies a watchdog at negligible cost. Thread safety:
/// one thread.
class StillSource final : public frames::FrameSource {
 public:
  explicit StillSource(frames::WovenFrame frame) : frame_(std::move(frame)) {}

  [[nodiscard]] frames::FrameGeometry geometry() const override { return frame_.geometry(); }
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return frames::Rate{1, 1}; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return 1; }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override {
    if (std::exchange(pulled_, true)) return frames::PullStatus::End;
    out = {.frame = frame_.view(), .number = 0, .token = 0};
    return frames::PullStatus::Ready;
  }
  void release(uint64_t token) override { (void)token; }
  [[nodiscard]] int max_acquired() const override { return 1'000'000; }
  [[nodiscard]] uint64_t ready_count() const override { return pulled_ ? 0 : 1; }
  [[nodiscard]] bool saturated() const override { return true; }
  [[nodiscard]] bool rewind() override { return std::exchange(pulled_, false); }
  [[nodiscard]] int wake_fd() const override { return -1; }
  void service() override {}
  [[nodiscard]] std::string failure() const override { return {}; }

 private:
  frames::WovenFrame frame_;
  bool pulled_ = false;
};

}  // namespace lenticule::player
