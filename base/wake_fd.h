// SPDX-License-Identifier: Apache-2.0
// WakeFd is a non-blocking eventfd that wakes a thread waiting in poll().
#pragma once

namespace lenticule {

class WakeFd {
 public:
  /// Throws Error(Failed) when the process has no free descriptor.
  WakeFd();
  ~WakeFd();
  WakeFd(const WakeFd&) = delete;
  WakeFd& operator=(const WakeFd&) = delete;

  /// Returns the descriptor, which is readable between signal() and drain().
  [[nodiscard]] int fd() const noexcept { return fd_; }
  void signal() noexcept;
  void drain() noexcept;

 private:
  int fd_;
};

}  // namespace lenticule
