// SPDX-License-Identifier: Apache-2.0
// Loaded before the C library, this library sets the time of day of one process wrong: the file
// that the environment variable LENTICULE_CLOCK_SHIFT names contains the difference in nanoseconds,
// and may change at any time. No namespace of the kernel has a CLOCK_REALTIME of its own.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <ctime>

namespace {

constexpr int64_t kSecond = 1'000'000'000;
constexpr int64_t kNoShift = 0;

const int64_t* map_shift() {
  const char* const name = std::getenv("LENTICULE_CLOCK_SHIFT");
  const int fd = name != nullptr ? ::open(name, O_RDONLY | O_CLOEXEC) : -1;
  if (fd < 0) return &kNoShift;
  void* const memory = ::mmap(nullptr, sizeof(int64_t), PROT_READ, MAP_SHARED, fd, 0);
  ::close(fd);
  return memory != MAP_FAILED ? static_cast<const int64_t*>(memory) : &kNoShift;
}

}  // namespace

extern "C" int clock_gettime(clockid_t clock, timespec* time) noexcept {
  using Function = int (*)(clockid_t, timespec*);
  static const auto real = reinterpret_cast<Function>(dlsym(RTLD_NEXT, "clock_gettime"));
  static const int64_t* const shift = map_shift();
  const int result = real(clock, time);
  if (result != 0 || clock != CLOCK_REALTIME) return result;
  const int64_t now =
      time->tv_sec * kSecond + time->tv_nsec + __atomic_load_n(shift, __ATOMIC_RELAXED);
  *time = {.tv_sec = now / kSecond, .tv_nsec = now % kSecond};
  return result;
}
