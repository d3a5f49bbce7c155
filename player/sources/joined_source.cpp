// SPDX-License-Identifier: Apache-2.0
#include "player/sources/joined_source.h"

#include <fmt/format.h>
#include <sys/epoll.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "base/error.h"

namespace lenticule::player {
namespace {

using frames::PullStatus;

/// Throws Error(Input) if two films cannot be played as one.
void require_equal(const JoinedSource::Part& a, const JoinedSource::Part& b) {
  constexpr const char* kRemedy = "render the films of a wall together: lenticule render --wall";
  const auto count_a = a.source->frame_count(), count_b = b.source->frame_count();
  if (count_a && count_b && *count_a != *count_b)
    throw Error(ErrorKind::Input,
                fmt::format("{} has {} frames, and {} has {}", a.name, *count_a, b.name, *count_b),
                kRemedy);
  const auto rate_a = a.source->rate(), rate_b = b.source->rate();
  if (rate_a && rate_b && *rate_a != *rate_b)
    throw Error(ErrorKind::Input,
                fmt::format("{} has {} frames a second, and {} has {}", a.name,
                            frames::to_string(*rate_a), b.name, frames::to_string(*rate_b)),
                kRemedy);
}

UniqueFd wake_descriptor(const std::vector<JoinedSource::Part>& parts) {
  if (std::ranges::all_of(parts, [](const auto& part) { return part.source->wake_fd() < 0; }))
    return {};
  UniqueFd wake(::epoll_create1(EPOLL_CLOEXEC));
  if (!wake) throw Error(ErrorKind::Failed, fmt::format("no descriptor: {}", std::strerror(errno)));
  for (const JoinedSource::Part& part : parts) {
    epoll_event event{.events = EPOLLIN, .data = {}};
    const int fd = part.source->wake_fd();
    if (fd >= 0 && ::epoll_ctl(wake.get(), EPOLL_CTL_ADD, fd, &event) != 0)
      throw Error(ErrorKind::Failed, fmt::format("{}: {}", part.name, std::strerror(errno)));
  }
  return wake;
}

}  // namespace

JoinedSource::JoinedSource(std::vector<Part> parts, frames::FrameGeometry geometry)
    : parts_(std::move(parts)), geometry_(geometry), wake_(wake_descriptor(parts_)) {
  LENTICULE_CHECK(!parts_.empty());
  for (const Part& part : parts_) require_equal(parts_.front(), part);
}

PullStatus JoinedSource::pull(frames::AcquiredFrame& out) {
  if (const PullStatus status = pull_missing(); status != PullStatus::Ready) return status;
  for (const frames::AcquiredFrame& part : next_.acquired) next_.views.push_back(part.frame);
  const uint64_t token = next_token_++;
  const Frame& frame = lent_[token] = std::exchange(next_, {});
  out = {.frame = {.geometry = geometry_, .bytes = {}, .parts = frame.views},
         .number = frame.acquired.front().number,
         .token = token};
  return PullStatus::Ready;
}

/// Pulls the frames of those parts whose frame has not arrived yet, in the order of the parts.
PullStatus JoinedSource::pull_missing() {
  while (next_.acquired.size() < parts_.size()) {
    const Part& part = parts_[next_.acquired.size()];
    frames::AcquiredFrame frame;
    switch (part.source->pull(frame)) {
      case PullStatus::Ready:
        break;
      case PullStatus::NotYet:
        return PullStatus::NotYet;
      case PullStatus::End:
        if (next_.acquired.empty()) return PullStatus::End;
        return fail(part, fmt::format("ends before {}", parts_.front().name));
      case PullStatus::Failed:
        return fail(part, part.source->failure());
    }
    next_.acquired.push_back(frame);
    if (frame.number != next_.acquired.front().number)
      return fail(part, fmt::format("frame {} comes with frame {} of {}", frame.number,
                                    next_.acquired.front().number, parts_.front().name));
  }
  return PullStatus::Ready;
}

PullStatus JoinedSource::fail(const Part& part, const std::string& why) {
  failure_ = fmt::format("{}: {}", part.name, why);
  return PullStatus::Failed;
}

void JoinedSource::release(uint64_t token) {
  const auto found = lent_.find(token);
  LENTICULE_CHECK(found != lent_.end());
  for (size_t n = 0; n < parts_.size(); ++n)
    parts_[n].source->release(found->second.acquired[n].token);
  lent_.erase(found);
}

/// A frame that waits for those of other parts is acquired, too.
int JoinedSource::max_acquired() const {
  const auto fewest = std::ranges::min_element(
      parts_, {}, [](const Part& part) { return part.source->max_acquired(); });
  return fewest->source->max_acquired();
}

uint64_t JoinedSource::ready_count() const {
  uint64_t least = UINT64_MAX;
  for (size_t n = 0; n < parts_.size(); ++n)
    least = std::min(least, parts_[n].source->ready_count() + (n < next_.acquired.size() ? 1 : 0));
  return least;
}

bool JoinedSource::saturated() const {
  return std::ranges::all_of(parts_, [](const Part& part) { return part.source->saturated(); });
}

bool JoinedSource::rewind() {
  return std::ranges::all_of(parts_, [](const Part& part) { return part.source->rewind(); });
}

void JoinedSource::service() {
  for (const Part& part : parts_) part.source->service();
}

frames::FrameDamage JoinedSource::damage() const {
  frames::FrameDamage all;
  for (const Part& part : parts_) all += part.source->damage();
  return all;
}

}  // namespace lenticule::player
