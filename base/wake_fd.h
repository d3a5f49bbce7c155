// SPDX-License-Identifier: Apache-2.0
// WakeFd is a non-blocking eventfd that wakes a thread waiting in poll().
#pragma once

#include "base/unique_fd.h"

namespace lenticule {

class WakeFd {
 public:
  /// Throws Error(Failed) "OWNER: no eventfd: cause" when the process has no free descriptor.
  explicit WakeFd(const char* owner = "player");
  WakeFd(const WakeFd&) = delete;
  WakeFd& operator=(const WakeFd&) = delete;

  /// Returns the descriptor, which is readable between signal() and drain().
  [[nodiscard]] int fd() const noexcept { return fd_.get(); }
  void signal() const noexcept;
  void drain() const noexcept;

 private:
  UniqueFd fd_;
};

}  // namespace lenticule
