// SPDX-License-Identifier: Apache-2.0
// Defines owners of FFmpeg's types, and FFmpeg's reading and writing of descriptors.
#pragma once

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <memory>
#include <string>

#include "apps/lenticule-video/ffmpeg.h"
#include "base/error.h"
#include "base/owned.h"

namespace lenticule::video {

/// Calls a function that frees an object and clears the pointer to it.
template <auto kFree>
struct Free {
  void operator()(auto* object) const { kFree(&object); }
};
struct FreeIo {
  void operator()(AVIOContext* io) const {
    av_freep(&io->buffer);
    avio_context_free(&io);
  }
};

using AvFrame = std::unique_ptr<AVFrame, Free<av_frame_free>>;
using AvPacket = std::unique_ptr<AVPacket, Free<av_packet_free>>;
using AvCodec = std::unique_ptr<AVCodecContext, Free<avcodec_free_context>>;
using SwResampler = std::unique_ptr<SwrContext, Free<swr_free>>;
using AvIo = std::unique_ptr<AVIOContext, FreeIo>;
using AvInput = std::unique_ptr<AVFormatContext, Free<avformat_close_input>>;
using AvOutput = Owned<AVFormatContext, avformat_free_context>;

[[nodiscard]] inline std::string av_reason(int error) {
  char text[AV_ERROR_MAX_STRING_SIZE] = {};
  av_strerror(error, text, sizeof text);
  return text;
}

inline constexpr int kBufferBytes = 1 << 16;

inline int fd_of(void* opaque) { return *static_cast<const int*>(opaque); }

inline int read_some(void* opaque, uint8_t* out, int bytes) {
  ssize_t n = 0;
  do {
    n = ::read(fd_of(opaque), out, static_cast<size_t>(bytes));
  } while (n < 0 && errno == EINTR);
  if (n < 0) return AVERROR(errno);
  return n == 0 ? AVERROR_EOF : static_cast<int>(n);
}

inline int write_all(void* opaque, AvioBytes* in, int bytes) {
  for (int done = 0; done < bytes;) {
    const ssize_t n = ::write(fd_of(opaque), in + done, static_cast<size_t>(bytes - done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return AVERROR(errno);
    done += static_cast<int>(n);
  }
  return bytes;
}

inline int64_t seek(void* opaque, int64_t offset, int whence) {
  if ((whence & AVSEEK_SIZE) != 0) {
    struct stat status {};
    return fstat(fd_of(opaque), &status) == 0 ? status.st_size : AVERROR(errno);
  }
  const off_t at = ::lseek(fd_of(opaque), offset, whence & ~AVSEEK_FORCE);
  return at < 0 ? AVERROR(errno) : at;
}

/// Lets FFmpeg read or write an open descriptor instead of a named file. Lifetime: the descriptor
/// stays its owner's and must outlive the result. Throws Error(Failed).
[[nodiscard]] inline AvIo make_io(const int& fd, bool writes) {
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
