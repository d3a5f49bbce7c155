// SPDX-License-Identifier: Apache-2.0
// JoinedSource joins the sources of the panels of a wall: each of its frames has the frames of all
// panels with one number.
#pragma once

#include <fmt/format.h>
#include <sys/epoll.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
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
  JoinedSource(std::vector<Part> parts, frames::FrameGeometry geometry)
      : parts_(std::move(parts)), geometry_(geometry), wake_(wake_descriptor(parts_)) {
    LENTICULE_CHECK(!parts_.empty());
    for (const Part& part : parts_) require_equal(parts_.front(), part);
  }

  [[nodiscard]] frames::FrameGeometry geometry() const override { return geometry_; }
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return first().rate(); }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override {
    return first().frame_count();
  }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override {
    if (const frames::PullStatus status = pull_missing(); status != frames::PullStatus::Ready)
      return status;
    for (const frames::AcquiredFrame& part : next_.acquired) next_.views.push_back(part.frame);
    const uint64_t token = next_token_++;
    const Frame& frame = lent_[token] = std::exchange(next_, {});
    out = {.frame = {.geometry = geometry_, .bytes = {}, .parts = frame.views},
           .number = frame.acquired.front().number,
           .token = token};
    return frames::PullStatus::Ready;
  }
  void release(uint64_t token) override {
    const auto found = lent_.find(token);
    LENTICULE_CHECK(found != lent_.end());
    for (size_t n = 0; n < parts_.size(); ++n)
      parts_[n].source->release(found->second.acquired[n].token);
    lent_.erase(found);
  }
  /// A frame that waits for those of other parts is acquired, too.
  [[nodiscard]] int max_acquired() const override {
    const auto fewest = std::ranges::min_element(
        parts_, {}, [](const Part& part) { return part.source->max_acquired(); });
    return fewest->source->max_acquired();
  }
  [[nodiscard]] uint64_t ready_count() const override {
    uint64_t least = UINT64_MAX;
    for (size_t n = 0; n < parts_.size(); ++n)
      least =
          std::min(least, parts_[n].source->ready_count() + (n < next_.acquired.size() ? 1 : 0));
    return least;
  }
  [[nodiscard]] bool saturated() const override {
    return std::ranges::all_of(parts_, [](const Part& part) { return part.source->saturated(); });
  }
  [[nodiscard]] bool rewind() override {
    return std::ranges::all_of(parts_, [](const Part& part) { return part.source->rewind(); });
  }
  [[nodiscard]] int wake_fd() const override { return wake_.get(); }
  void service() override {
    for (const Part& part : parts_) part.source->service();
  }
  [[nodiscard]] std::string failure() const override { return failure_; }
  [[nodiscard]] frames::FrameDamage damage() const override {
    frames::FrameDamage all;
    for (const Part& part : parts_) all += part.source->damage();
    return all;
  }
  [[nodiscard]] bool nothing_due() const override { return first().nothing_due(); }

 private:
  /// Throws Error(Input) if two films cannot be played as one.
  static void require_equal(const Part& a, const Part& b) {
    constexpr const char* kRemedy = "render the films of a wall together: lenticule render --wall";
    const auto count_a = a.source->frame_count(), count_b = b.source->frame_count();
    if (count_a && count_b && *count_a != *count_b)
      throw Error(
          ErrorKind::Input,
          fmt::format("{} has {} frames, and {} has {}", a.name, *count_a, b.name, *count_b),
          kRemedy);
    const auto rate_a = a.source->rate(), rate_b = b.source->rate();
    if (rate_a && rate_b && *rate_a != *rate_b)
      throw input_error("{} has {} frames a second, and {} has {}", a.name,
                        frames::to_string(*rate_a), b.name, frames::to_string(*rate_b))
          .remedy(kRemedy);
  }

  static UniqueFd wake_descriptor(const std::vector<Part>& parts) {
    if (std::ranges::all_of(parts, [](const auto& part) { return part.source->wake_fd() < 0; }))
      return {};
    UniqueFd wake(::epoll_create1(EPOLL_CLOEXEC));
    if (!wake) throw failed_error("no descriptor: {}", std::strerror(errno));
    for (const Part& part : parts) {
      epoll_event event{.events = EPOLLIN, .data = {}};
      const int fd = part.source->wake_fd();
      if (fd >= 0 && ::epoll_ctl(wake.get(), EPOLL_CTL_ADD, fd, &event) != 0)
        throw failed_error("{}: {}", part.name, std::strerror(errno));
    }
    return wake;
  }

  /// Frame holds the parts' frames of one number. They arrive in the order of the parts.
  struct Frame {
    std::vector<frames::AcquiredFrame> acquired{};  ///< frames that have arrived
    std::vector<frames::FrameView> views{};         ///< their pictures, once all have arrived
  };

  [[nodiscard]] const frames::FrameSource& first() const { return *parts_.front().source; }
  /// Pulls the frames of those parts whose frame has not arrived yet, in the order of the parts.
  [[nodiscard]] frames::PullStatus pull_missing() {
    while (next_.acquired.size() < parts_.size()) {
      const Part& part = parts_[next_.acquired.size()];
      frames::AcquiredFrame frame;
      switch (part.source->pull(frame)) {
        case frames::PullStatus::Ready:
          break;
        case frames::PullStatus::NotYet:
          return frames::PullStatus::NotYet;
        case frames::PullStatus::End:
          if (next_.acquired.empty()) return frames::PullStatus::End;
          return fail(part, fmt::format("ends before {}", parts_.front().name));
        case frames::PullStatus::Failed:
          return fail(part, part.source->failure());
      }
      next_.acquired.push_back(frame);
      if (frame.number != next_.acquired.front().number)
        return fail(part, fmt::format("frame {} comes with frame {} of {}", frame.number,
                                      next_.acquired.front().number, parts_.front().name));
    }
    return frames::PullStatus::Ready;
  }
  frames::PullStatus fail(const Part& part, const std::string& why) {
    failure_ = fmt::format("{}: {}", part.name, why);
    return frames::PullStatus::Failed;
  }

  std::vector<Part> parts_;
  frames::FrameGeometry geometry_;
  UniqueFd wake_;  ///< an epoll descriptor; none if no part has a descriptor
  Frame next_;
  std::map<uint64_t, Frame> lent_;  ///< the key is the token
  uint64_t next_token_ = 1;
  std::string failure_;
};

}  // namespace lenticule::player
