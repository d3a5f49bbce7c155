// SPDX-License-Identifier: Apache-2.0
#include "frames/sequence/file_bytes.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <limits>

namespace lenticule::frames {
namespace {

bool fits_offset(uint64_t offset, size_t bytes) {
  constexpr auto kMost = static_cast<uint64_t>(std::numeric_limits<off_t>::max());
  return offset <= kMost && bytes <= kMost - offset;
}

}  // namespace

uint64_t size_of(int fd) noexcept {
  struct stat status {};
  return ::fstat(fd, &status) == 0 ? static_cast<uint64_t>(status.st_size) : 0;
}

bool read_at(int fd, uint64_t offset, std::span<uint8_t> to) noexcept {
  if (!fits_offset(offset, to.size())) return false;
  while (!to.empty()) {
    const ssize_t count = ::pread(fd, to.data(), to.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    to = to.subspan(static_cast<size_t>(count));
    offset += static_cast<uint64_t>(count);
  }
  return true;
}

bool write_at(int fd, uint64_t offset, std::span<const uint8_t> from) noexcept {
  if (!fits_offset(offset, from.size())) {
    errno = EFBIG;
    return false;
  }
  while (!from.empty()) {
    const ssize_t count = ::pwrite(fd, from.data(), from.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    from = from.subspan(static_cast<size_t>(count));
    offset += static_cast<uint64_t>(count);
  }
  return true;
}

}  // namespace lenticule::frames
