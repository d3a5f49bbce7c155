// SPDX-License-Identifier: Apache-2.0
// Reads a card's events, and waits for them and for other descriptors. Events carry numbers, never
// pointers: a process that takes over a card also receives the events of the previous process.
#pragma once

#include <drm.h>
#include <poll.h>
#include <sys/epoll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <span>

#include "base/error_kinds.h"
#include "base/unique_fd.h"
#include "display/clock.h"
#include "display/display.h"

namespace lenticule::display {

struct DrmEvent {
  enum class Kind { Flip, Sequence };
  Kind kind = Kind::Flip;
  uint64_t id = 0;
  uint64_t sequence = 0;  ///< low 32 bits for flips
  Nanoseconds time{0};    ///< CLOCK_MONOTONIC; 0 if the driver does not know
  uint32_t crtc = 0;      ///< set for flips
};

enum class EventRead {
  Ok,         ///< all available events were handled
  Truncated,  ///< an incomplete event was found; the events before it were handled
  Gone,       ///< the card is gone
};

/// Copies the bytes into the kernel's structure; returns false if there are too few.
template <typename Event>
bool load(std::span<const uint8_t> bytes, Event& event) noexcept {
  if (bytes.size() < sizeof(Event)) return false;
  std::memcpy(&event, bytes.data(), sizeof(Event));
  return true;
}

/// Parses events that were read, and passes them to `handle`, which takes a DrmEvent.
template <class Handle>
[[nodiscard]] EventRead parse_drm_events(std::span<const uint8_t> bytes,
                                         const Handle& handle) noexcept {
  while (!bytes.empty()) {
    drm_event header{};
    if (!load(bytes, header) || header.length < sizeof(header) || header.length > bytes.size())
      return EventRead::Truncated;
    const auto event = bytes.first(header.length);
    if (header.type == DRM_EVENT_FLIP_COMPLETE) {
      drm_event_vblank flip{};
      if (!load(event, flip)) return EventRead::Truncated;
      handle(DrmEvent{
          .kind = DrmEvent::Kind::Flip,
          .id = flip.user_data,
          .sequence = flip.sequence,
          .time = std::chrono::seconds(flip.tv_sec) + std::chrono::microseconds(flip.tv_usec),
          .crtc = flip.crtc_id});
    } else if (header.type == DRM_EVENT_CRTC_SEQUENCE) {
      drm_event_crtc_sequence vblank{};
      if (!load(event, vblank)) return EventRead::Truncated;
      handle(DrmEvent{.kind = DrmEvent::Kind::Sequence,
                      .id = vblank.user_data,
                      .sequence = vblank.sequence,
                      .time = Nanoseconds(vblank.time_ns)});
    }
    bytes = bytes.subspan(header.length);
  }
  return EventRead::Ok;
}

inline constexpr size_t kReadBytes = 4096;

inline bool readable(int fd) noexcept {
  pollfd entry{.fd = fd, .events = POLLIN, .revents = 0};
  return poll(&entry, 1, 0) == 1;
}

/// Reads once, without blocking, and passes every complete event to `handle`.
template <class Handle>
[[nodiscard]] EventRead read_drm_events(int fd, const Handle& handle) noexcept {
  // A descriptor of the previous player may be in blocking mode, so check before reading.
  if (!readable(fd)) return EventRead::Ok;
  std::array<uint8_t, kReadBytes> buffer;
  const ssize_t count = read(fd, buffer.data(), buffer.size());
  if (count > 0) return parse_drm_events({buffer.data(), static_cast<size_t>(count)}, handle);
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return EventRead::Ok;
  return EventRead::Gone;
}

struct ReadySet {
  bool card = false;
  bool card_gone = false;
  bool hotplug = false;
  bool wake = false;  ///< the caller's own descriptor
};

/// EventWaiter waits for several descriptors at once by the display's clock. It allocates no memory
/// after construction. Thread safety: one thread.
class EventWaiter {
 public:
  /// Descriptors of -1 are never ready. Throws Error(Failed).
  EventWaiter(int card_fd, int hotplug_fd) : epoll_(epoll_create1(EPOLL_CLOEXEC)) {
    if (!epoll_)
      throw failed_error("kms: cannot create an epoll descriptor: {}", std::strerror(errno))
          .remedy("raise the limit of open files");
    add(card_fd, kCard);
    add(hotplug_fd, kHotplug);
  }

  /// Waits until a descriptor is ready or `deadline` has passed; `wake_fd` as for
  /// Display::wait_event().
  [[nodiscard]] ReadySet wait(Clock& clock, Nanoseconds deadline, int wake_fd) noexcept {
    watch_wake(wake_fd);
    (void)clock.wait_until(deadline, epoll_.get());
    std::array<epoll_event, 3> entries{};
    const int count = epoll_wait(epoll_.get(), entries.data(), static_cast<int>(entries.size()), 0);
    ReadySet ready;
    for (int i = 0; i < count; ++i) {
      const epoll_event& entry = entries[static_cast<size_t>(i)];
      switch (entry.data.u32) {
        case kCard:
          ready.card = (entry.events & EPOLLIN) != 0;
          ready.card_gone = (entry.events & (EPOLLHUP | EPOLLERR)) != 0;
          break;
        case kHotplug:
          ready.hotplug = true;
          break;
        default:
          ready.wake = true;
      }
    }
    return ready;
  }

 private:
  enum Source : uint32_t { kCard, kHotplug, kWake };

  void add(int fd, Source source) {
    if (fd < 0) return;
    epoll_event entry{.events = EPOLLIN, .data = {.u32 = source}};
    if (epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &entry) != 0)
      throw failed_error("kms: cannot wait for a descriptor: {}", std::strerror(errno));
  }
  /// Registers the wake descriptor. Its number may belong to another file than last time;
  /// EPOLL_CTL_MOD detects that, and usually this is a single system call.
  void watch_wake(int fd) noexcept {
    epoll_event entry{.events = EPOLLIN, .data = {.u32 = kWake}};
    if (wake_fd_ >= 0 && wake_fd_ != fd) epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, wake_fd_, nullptr);
    wake_fd_ = fd;
    if (fd >= 0 && epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, fd, &entry) != 0 && errno == ENOENT)
      epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &entry);
  }

  UniqueFd epoll_;
  int wake_fd_ = -1;
};

}  // namespace lenticule::display
