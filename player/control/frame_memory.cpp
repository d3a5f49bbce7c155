// SPDX-License-Identifier: Apache-2.0
#include "player/control/frame_memory.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <string>

#include "base/error.h"

namespace lenticule::player {
namespace {

[[noreturn]] void fail(const char* cause) {
  throw Error(ErrorKind::Failed, std::string("frame: ") + cause + ": " + std::strerror(errno));
}

}  // namespace

FrameMemory::FrameMemory(const frames::FrameGeometry& geometry) : pixels_(geometry.frame_bytes()) {
  UniqueFd fd(::memfd_create("lenticule-frame", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  const size_t bytes = kPixelsAt + pixels_ + kMaxText;  // pages without content take no memory
  if (!fd || ::ftruncate(fd.get(), static_cast<off_t>(bytes)) != 0) fail("no shared memory");
  void* const mapped = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd.get(), 0);
  if (mapped == MAP_FAILED) fail("no shared memory");
  bytes_ = static_cast<uint8_t*>(mapped);
  constexpr int kSeals = F_SEAL_FUTURE_WRITE | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL;
  if (::fcntl(fd.get(), F_ADD_SEALS, kSeals) != 0) {
    const int error = errno;
    ::munmap(bytes_, bytes);
    errno = error;
    fail("cannot seal shared memory");
  }
  fd_ = std::make_shared<const UniqueFd>(std::move(fd));
}

FrameMemory::~FrameMemory() {
  ::munmap(bytes_, kPixelsAt + pixels_ + kMaxText);
}

uint64_t FrameMemory::write(const frames::WovenFrame& frame, std::string_view text) {
  LENTICULE_CHECK(frame.bytes().size() == pixels_);
  if (text.size() > kMaxText)
    throw Error(ErrorKind::Failed, "frame: the rig is too large to be sent");
  auto& shared = *reinterpret_cast<uint64_t*>(bytes_);
  std::atomic_ref<uint64_t> serial(shared);
  serial.store(0);
  std::atomic_thread_fence(std::memory_order_seq_cst);
  std::memcpy(bytes_ + kPixelsAt, frame.bytes().data(), pixels_);
  std::memcpy(bytes_ + kPixelsAt + pixels_, text.data(), text.size());
  serial.store(++serial_);
  return serial_;
}

}  // namespace lenticule::player
