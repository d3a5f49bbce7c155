// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-video/av_handles.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "base/error.h"

namespace lenticule::video {
namespace {

constexpr int kBufferBytes = 1 << 16;

int fd_of(void* opaque) {
  return *static_cast<const int*>(opaque);
}

int read_some(void* opaque, uint8_t* out, int bytes) {
  ssize_t n = 0;
  do {
    n = ::read(fd_of(opaque), out, static_cast<size_t>(bytes));
  } while (n < 0 && errno == EINTR);
  if (n < 0) return AVERROR(errno);
  return n == 0 ? AVERROR_EOF : static_cast<int>(n);
}

int write_all(void* opaque, AvioBytes* in, int bytes) {
  for (int done = 0; done < bytes;) {
    const ssize_t n = ::write(fd_of(opaque), in + done, static_cast<size_t>(bytes - done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return AVERROR(errno);
    done += static_cast<int>(n);
  }
  return bytes;
}

int64_t seek(void* opaque, int64_t offset, int whence) {
  if ((whence & AVSEEK_SIZE) != 0) {
    struct stat status {};
    return fstat(fd_of(opaque), &status) == 0 ? status.st_size : AVERROR(errno);
  }
  const off_t at = ::lseek(fd_of(opaque), offset, whence & ~AVSEEK_FORCE);
  return at < 0 ? AVERROR(errno) : at;
}

}  // namespace

AvIo make_io(const int& fd, bool writes) {
  auto* const buffer = static_cast<uint8_t*>(av_malloc(kBufferBytes));
  auto* const opaque = const_cast<int*>(&fd);
  AVIOContext* const io = buffer == nullptr
                              ? nullptr
                              : avio_alloc_context(buffer, kBufferBytes, writes ? 1 : 0, opaque,
                                                   read_some, write_all, seek);
  if (io == nullptr) {
    av_free(buffer);
    throw Error(ErrorKind::Failed, "video: out of memory");
  }
  return AvIo(io);
}

}  // namespace lenticule::video
