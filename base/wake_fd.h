// SPDX-License-Identifier: Apache-2.0
// An eventfd: one thread taps another on the shoulder, and poll() feels it.
#pragma once

namespace lenticule {

class WakeFd {
 public:
  /// Throws Error(Failed) when no descriptor is left.
  WakeFd();
  ~WakeFd();
  WakeFd(const WakeFd&) = delete;
  WakeFd& operator=(const WakeFd&) = delete;

  /// Readable from signal() to drain().
  [[nodiscard]] int fd() const noexcept { return fd_; }
  void signal() noexcept;
  void drain() noexcept;

 private:
  int fd_;
};

}  // namespace lenticule
