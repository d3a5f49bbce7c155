// SPDX-License-Identifier: Apache-2.0
// UniqueFd owns one file descriptor and closes it; WakeFd owns one that wakes a thread.
#pragma once

#include <unistd.h>

#include <utility>

namespace lenticule {

class UniqueFd {
 public:
  UniqueFd() = default;
  explicit UniqueFd(int fd) : fd_(fd) {}
  UniqueFd(UniqueFd&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  UniqueFd& operator=(UniqueFd&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~UniqueFd() {
    if (fd_ >= 0) ::close(fd_);
  }

  [[nodiscard]] int get() const { return fd_; }
  explicit operator bool() const { return fd_ >= 0; }
  void reset() { UniqueFd closed(std::exchange(fd_, -1)); }

 private:
  int fd_ = -1;
};

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
