// SPDX-License-Identifier: Apache-2.0
// Makes allocations and starts of threads fail, by a limit of the address space. Sanitizers need
// address space without a limit: with them there is no such class.
#pragma once

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <utility>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define LENTICULE_LIMITS_MEMORY 0
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define LENTICULE_LIMITS_MEMORY 0
#endif
#endif
#ifndef LENTICULE_LIMITS_MEMORY
#define LENTICULE_LIMITS_MEMORY 1
#endif

#if LENTICULE_LIMITS_MEMORY
namespace lenticule::test {

/// LittleMemory lets the process have only `mebibytes` more memory while the object lives: it takes
/// what the C library has kept, and limits the address space.
class LittleMemory {
 public:
  explicit LittleMemory(size_t mebibytes) {
    ::getrlimit(RLIMIT_AS, &before_);
    limit_to(address_space());
    while (void* const block = std::malloc(kBlock)) {
      *static_cast<void**>(block) = kept_;
      kept_ = block;
    }
    limit_to(address_space() + (mebibytes << 20));
  }
  ~LittleMemory() {
    ::setrlimit(RLIMIT_AS, &before_);
    while (kept_ != nullptr) std::free(std::exchange(kept_, *static_cast<void**>(kept_)));
  }
  LittleMemory(const LittleMemory&) = delete;
  LittleMemory& operator=(const LittleMemory&) = delete;

 private:
  static constexpr size_t kBlock = size_t{16} << 10;

  /// Reads without allocating.
  static size_t address_space() {
    char text[64] = {};
    const int fd = ::open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
    (void)!::read(fd, text, sizeof text - 1);
    ::close(fd);
    return std::strtoull(text, nullptr, 10) * static_cast<size_t>(::sysconf(_SC_PAGESIZE));
  }
  void limit_to(size_t bytes) const {
    rlimit limit = before_;
    limit.rlim_cur = bytes;
    ::setrlimit(RLIMIT_AS, &limit);
  }

  rlimit before_{};
  void* kept_ = nullptr;  ///< a list: each block begins with the address of the next
};

/// Enough for the stacks of some threads, but not of 64.
inline constexpr size_t kFewStacks = 60;

}  // namespace lenticule::test
#endif
