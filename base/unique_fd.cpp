// SPDX-License-Identifier: Apache-2.0
#include "base/unique_fd.h"

#include <sys/eventfd.h>

#include <cerrno>
#include <cstring>

#include "base/error_kinds.h"

namespace lenticule {

WakeFd::WakeFd(const char* owner) : fd_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (!fd_)
    throw failed_error("{}: cannot create an eventfd: {}", owner, std::strerror(errno))
        .remedy("raise the limit of open files");
}

void WakeFd::signal() const noexcept { (void)eventfd_write(fd_.get(), 1); }

void WakeFd::drain() const noexcept {
  eventfd_t count = 0;
  (void)eventfd_read(fd_.get(), &count);
}

}  // namespace lenticule
