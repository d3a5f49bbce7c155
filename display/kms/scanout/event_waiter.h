// SPDX-License-Identifier: Apache-2.0
// EventWaiter waits for several descriptors at once by the display's clock.
#pragma once

#include <array>

#include "base/unique_fd.h"
#include "display/clock.h"

namespace lenticule::display {

struct ReadySet {
  bool card = false;
  bool card_gone = false;
  bool session = false;
  bool watch = false;
  bool wake = false;  ///< the caller's own descriptor
};

/// Allocates no memory after construction. Thread safety: one thread.
class EventWaiter {
 public:
  /// Descriptors of -1 are never ready. Throws Error(Failed).
  EventWaiter(int card_fd, int session_fd, int watch_fd);

  /// Waits until a descriptor is ready or `deadline` has passed; `wake_fd` as for
  /// Display::wait_event().
  [[nodiscard]] ReadySet wait(Clock& clock, Nanoseconds deadline, int wake_fd) noexcept;

 private:
  enum Source : uint32_t { kCard, kSession, kWatch, kWake };

  void add(int fd, Source source);
  void watch_wake(int fd) noexcept;

  UniqueFd epoll_;
  int wake_fd_ = -1;
};

}  // namespace lenticule::display
