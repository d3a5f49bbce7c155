// SPDX-License-Identifier: Apache-2.0
// ViewsSource presents the numbered views of a rig as an endless source for trimming. It weaves
// them again whenever the trim changes.
#pragma once

#include <map>
#include <memory>

#include "frames/frame_source.h"
#include "player/sources/live_trim.h"

namespace lenticule::player {

/// A new trim is displayed within a second. Thread safety: one thread.
class ViewsSource final : public frames::FrameSource {
 public:
  explicit ViewsSource(std::shared_ptr<const LiveTrim> trim);

  [[nodiscard]] frames::FrameGeometry geometry() const override { return newest_->geometry(); }
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return frames::Rate{4, 1}; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return 1; }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override;
  void release(uint64_t token) override { acquired_.erase(token); }
  [[nodiscard]] int max_acquired() const override { return 1'000'000; }
  [[nodiscard]] uint64_t ready_count() const override { return pulled_ ? 0 : 1; }
  [[nodiscard]] bool saturated() const override { return true; }
  [[nodiscard]] bool rewind() override;
  [[nodiscard]] int wake_fd() const override { return -1; }
  void service() override {}
  [[nodiscard]] std::string failure() const override { return {}; }

 private:
  void weave();

  std::shared_ptr<const LiveTrim> trim_;
  uint64_t version_ = 0;
  std::shared_ptr<const frames::WovenFrame> newest_;
  /// Keeps frames acquired before a change alive and unchanged.
  std::map<uint64_t, std::shared_ptr<const frames::WovenFrame>> acquired_;
  uint64_t next_token_ = 0;
  bool pulled_ = false;
};

}  // namespace lenticule::player
