// SPDX-License-Identifier: Apache-2.0
// StillSource presents one picture that is generated here, such as a test card, as a source that
// never ends.
#pragma once

#include <map>
#include <memory>
#include <utility>

#include "frames/charts/charts.h"
#include "frames/frame_source.h"
#include "player/sources/live_rig.h"

namespace lenticule::player {

/// Delivers a frame once a second, which satisfies a watchdog at negligible cost. Thread safety:
/// one thread.
class StillSource final : public frames::FrameSource {
 public:
  explicit StillSource(frames::WovenFrame frame)
      : newest_(std::make_shared<const frames::WovenFrame>(std::move(frame))) {}
  /// Presents the numbered views of a rig for trimming, four times a second. Weaves them again
  /// whenever the rig or its trim changes.
  explicit StillSource(std::shared_ptr<const LiveRig> rig) : rig_(std::move(rig)) { weave_views(); }

  [[nodiscard]] frames::FrameGeometry geometry() const override { return newest_->geometry(); }
  [[nodiscard]] std::optional<frames::Rate> rate() const override {
    return frames::Rate{rig_ ? 4 : 1, 1};
  }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return 1; }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override {
    if (pulled_) return frames::PullStatus::End;
    if (rig_ && version_ != rig_->version()) weave_views();
    pulled_ = true;
    acquired_[next_token_] = newest_;
    out = {.frame = newest_->view(), .number = 0, .token = next_token_++};
    return frames::PullStatus::Ready;
  }
  void release(uint64_t token) override { acquired_.erase(token); }
  [[nodiscard]] int max_acquired() const override { return 1'000'000; }
  [[nodiscard]] uint64_t ready_count() const override { return pulled_ ? 0 : 1; }
  [[nodiscard]] bool saturated() const override { return true; }
  [[nodiscard]] bool rewind() override { return std::exchange(pulled_, false); }
  [[nodiscard]] int wake_fd() const override { return -1; }
  void service() override {}
  [[nodiscard]] std::string failure() const override { return {}; }

 private:
  void weave_views() {
    version_ = rig_->version();
    newest_ = std::make_shared<const frames::WovenFrame>(
        frames::draw_chart({.pattern = frames::ChartPattern::NumberedViews, .rig = rig_->rig()}));
  }

  const std::shared_ptr<const LiveRig> rig_;  ///< null: the picture never changes
  uint64_t version_ = 0;                      ///< version of the rig of newest_
  std::shared_ptr<const frames::WovenFrame> newest_;
  /// Keeps frames acquired before a change alive and unchanged.
  std::map<uint64_t, std::shared_ptr<const frames::WovenFrame>> acquired_;
  uint64_t next_token_ = 0;
  bool pulled_ = false;
};

}  // namespace lenticule::player
