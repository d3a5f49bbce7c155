// SPDX-License-Identifier: Apache-2.0
#include "frames/ring/ring_memory.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <new>
#include <string>

#include "base/error.h"

namespace lenticule::frames {
namespace {

constexpr size_t kMebibyte = size_t{1} << 20;

std::string mebibytes(size_t bytes) {
  return std::to_string((bytes + kMebibyte - 1) / kMebibyte) + " MiB";
}

[[noreturn]] void fail(const char* what) {
  throw Error(ErrorKind::Failed, std::string("ring: ") + what + ": " + std::strerror(errno));
}

void refuse_too_much(const RingLayout& layout) {
  const size_t available = available_memory();
  if (available == 0 || layout.memory_bytes <= available / 2) return;
  throw Error(ErrorKind::Failed,
              "ring: " + std::to_string(layout.slots) + " slots take " +
                  mebibytes(layout.memory_bytes) + ", more than half of the free " +
                  mebibytes(available),
              "use at most " + std::to_string(available / 2 / layout.slot_stride) + " slots");
}

UniqueFd create_memory(size_t bytes) {
  UniqueFd fd(::memfd_create("lenticule-ring", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (!fd) fail("cannot create shared memory");
  if (::ftruncate(fd.get(), static_cast<off_t>(bytes)) != 0) fail("cannot size shared memory");
  // The seals keep a renderer from shrinking the memory while it is mapped here: the next read
  // would raise SIGBUS.
  if (::fcntl(fd.get(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0)
    fail("cannot seal shared memory");
  return fd;
}

/// Allocates the pages now, so that a machine with too little memory fails here and not during
/// playback, and the first cycle through the ring has no page faults.
void take_pages(int fd, const Mapping& pixels, size_t bytes) {
  if (::fallocate(fd, 0, 0, static_cast<off_t>(bytes)) != 0) fail("cannot get shared memory");
#ifdef MADV_POPULATE_READ
  ::madvise(pixels.bytes().data(), pixels.bytes().size(), MADV_POPULATE_READ);  // else: lazily
#endif
}

}  // namespace

size_t available_memory() {
  std::ifstream meminfo("/proc/meminfo");
  std::string key;
  size_t kibibytes = 0;
  std::string unit;
  while (meminfo >> key >> kibibytes) {
    if (key == "MemAvailable:") return kibibytes * 1024;
    std::getline(meminfo, unit);
  }
  return 0;
}

RingMemory::RingMemory(const RingLayout& layout, RingPrefault prefault) : layout_(layout) {
  refuse_too_much(layout);
  fd_ = create_memory(layout.memory_bytes);
  control_ = Mapping(fd_.get(), 0, layout.slots_offset, PROT_READ | PROT_WRITE);
  if (!control_) fail("cannot map the slot table");
  pixels_ =
      Mapping(fd_.get(), layout.slots_offset, layout.memory_bytes - layout.slots_offset, PROT_READ);
  if (!pixels_) fail("cannot map the slots");
  ::madvise(pixels_.bytes().data(), pixels_.bytes().size(),
            MADV_HUGEPAGE);  // ignored if not allowed
  if (prefault == RingPrefault::AtStart) take_pages(fd_.get(), pixels_, layout.memory_bytes);
  write_header(layout, *new (control_.bytes().data()) RingHeader());
  for (int slot = 0; slot < layout.slots; ++slot) new (&table()[slot]) SlotEntry();
}

RingHeader& RingMemory::header() const {
  return *std::launder(reinterpret_cast<RingHeader*>(control_.bytes().data()));
}

std::span<SlotEntry> RingMemory::table() const {
  auto* first = reinterpret_cast<SlotEntry*>(control_.bytes().data() + layout_.table_offset);
  return {first, static_cast<size_t>(layout_.slots)};
}

FrameView RingMemory::frame(int slot) const {
  const size_t offset = static_cast<size_t>(slot) * layout_.slot_stride;
  return {layout_.geometry, pixels_.bytes().subspan(offset, layout_.geometry.frame_bytes())};
}

}  // namespace lenticule::frames
