// SPDX-License-Identifier: Apache-2.0
// JoinedSource joins the sources of the panels of a wall: each of its frames has the frames of all
// panels with one number.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/unique_fd.h"
#include "frames/frame_source.h"

namespace lenticule::player {

/// Thread safety: as for FrameSource.
class JoinedSource final : public frames::FrameSource {
 public:
  struct Part {
    std::string name;  ///< name in messages
    std::unique_ptr<frames::FrameSource> source;
  };

  /// `geometry` is the size of all parts together. Throws Error(Input) if the parts differ in rate
  /// or length, as far as they state them.
  JoinedSource(std::vector<Part> parts, frames::FrameGeometry geometry);

  [[nodiscard]] frames::FrameGeometry geometry() const override { return geometry_; }
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return first().rate(); }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override {
    return first().frame_count();
  }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override;
  void release(uint64_t token) override;
  [[nodiscard]] int max_acquired() const override;
  [[nodiscard]] uint64_t ready_count() const override;
  [[nodiscard]] bool saturated() const override;
  [[nodiscard]] bool rewind() override;
  [[nodiscard]] int wake_fd() const override { return wake_.get(); }
  void service() override;
  [[nodiscard]] std::string failure() const override { return failure_; }
  [[nodiscard]] frames::FrameDamage damage() const override;
  [[nodiscard]] bool nothing_due() const override { return first().nothing_due(); }

 private:
  /// Frame holds the parts' frames of one number. They arrive in the order of the parts.
  struct Frame {
    std::vector<frames::AcquiredFrame> acquired{};  ///< frames that have arrived
    std::vector<frames::FrameView> views{};         ///< their pictures, once all have arrived
  };

  [[nodiscard]] const frames::FrameSource& first() const { return *parts_.front().source; }
  [[nodiscard]] frames::PullStatus pull_missing();
  frames::PullStatus fail(const Part& part, const std::string& why);

  std::vector<Part> parts_;
  frames::FrameGeometry geometry_;
  UniqueFd wake_;  ///< an epoll descriptor; none if no part has a descriptor
  Frame next_;
  std::map<uint64_t, Frame> lent_;  ///< the key is the token
  uint64_t next_token_ = 1;
  std::string failure_;
};

}  // namespace lenticule::player
