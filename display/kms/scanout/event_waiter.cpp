// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/event_waiter.h"

#include <fmt/format.h>
#include <sys/epoll.h>

#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace lenticule::display {

EventWaiter::EventWaiter(int card_fd, int session_fd, int watch_fd)
    : epoll_(epoll_create1(EPOLL_CLOEXEC)) {
  if (!epoll_)
    throw Error(ErrorKind::Failed, fmt::format("kms: no epoll: {}", std::strerror(errno)),
                "raise the limit of open files");
  add(card_fd, kCard);
  add(session_fd, kSession);
  add(watch_fd, kWatch);
}

void EventWaiter::add(int fd, Source source) {
  if (fd < 0) return;
  epoll_event entry{.events = EPOLLIN, .data = {.u32 = source}};
  if (epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &entry) != 0)
    throw Error(ErrorKind::Failed,
                fmt::format("kms: cannot wait for a descriptor: {}", std::strerror(errno)));
}

/// Registers the wake descriptor. Its number may belong to another file than last time;
/// EPOLL_CTL_MOD detects that, and usually this is a single system call.
void EventWaiter::watch_wake(int fd) noexcept {
  epoll_event entry{.events = EPOLLIN, .data = {.u32 = kWake}};
  if (wake_fd_ >= 0 && wake_fd_ != fd) epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, wake_fd_, nullptr);
  wake_fd_ = fd;
  if (fd >= 0 && epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, fd, &entry) != 0 && errno == ENOENT)
    epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &entry);
}

ReadySet EventWaiter::wait(Clock& clock, Nanoseconds deadline, int wake_fd) noexcept {
  watch_wake(wake_fd);
  (void)clock.wait_until(deadline, epoll_.get());
  std::array<epoll_event, 4> entries{};
  const int count = epoll_wait(epoll_.get(), entries.data(), static_cast<int>(entries.size()), 0);
  ReadySet ready;
  for (int i = 0; i < count; ++i) {
    const epoll_event& entry = entries[static_cast<size_t>(i)];
    switch (entry.data.u32) {
      case kCard:
        ready.card = (entry.events & EPOLLIN) != 0;
        ready.card_gone = (entry.events & (EPOLLHUP | EPOLLERR)) != 0;
        break;
      case kSession:
        ready.session = true;
        break;
      case kWatch:
        ready.watch = true;
        break;
      default:
        ready.wake = true;
    }
  }
  return ready;
}

}  // namespace lenticule::display
