// SPDX-License-Identifier: Apache-2.0
#include "base/wake_fd.h"

#include <fmt/format.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace lenticule {

WakeFd::WakeFd() : fd_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (fd_ < 0)
    throw Error(ErrorKind::Failed, fmt::format("player: no eventfd: {}", std::strerror(errno)),
                "raise the limit of open files");
}

WakeFd::~WakeFd() {
  close(fd_);
}

void WakeFd::signal() noexcept {
  (void)eventfd_write(fd_, 1);
}

void WakeFd::drain() noexcept {
  eventfd_t count = 0;
  (void)eventfd_read(fd_, &count);
}

}  // namespace lenticule
