// SPDX-License-Identifier: Apache-2.0
// Makes allocations and starts of threads fail, by a limit of the address space. Sanitizers need
// address space without a limit: with them there is no such class.
#pragma once

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstddef>
#include <fstream>

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

/// LittleMemory lets the process have only `mebibytes` more address space while the object lives.
class LittleMemory {
 public:
  explicit LittleMemory(size_t mebibytes) {
    ::malloc_trim(0);
    ::getrlimit(RLIMIT_AS, &before_);
    size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    rlimit limit = before_;
    limit.rlim_cur = pages * static_cast<size_t>(::sysconf(_SC_PAGESIZE)) + (mebibytes << 20);
    ::setrlimit(RLIMIT_AS, &limit);
  }
  ~LittleMemory() { ::setrlimit(RLIMIT_AS, &before_); }
  LittleMemory(const LittleMemory&) = delete;
  LittleMemory& operator=(const LittleMemory&) = delete;

 private:
  rlimit before_{};
};

/// Enough for the stacks of some threads, but not of 64.
inline constexpr size_t kFewStacks = 60;

}  // namespace lenticule::test
#endif
