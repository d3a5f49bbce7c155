// SPDX-License-Identifier: Apache-2.0
// Counts the allocations of a test program, to check that running loops do not allocate. Only one
// source of a program may include this file. The address sanitizer has operators new of its own,
// which must not be mixed with these: then nothing is counted.
#pragma once

#include <atomic>
#include <cstdlib>
#include <new>

#if defined(__SANITIZE_ADDRESS__)
#define LENTICULE_COUNTS_ALLOCATIONS 0
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define LENTICULE_COUNTS_ALLOCATIONS 0
#endif
#endif
#ifndef LENTICULE_COUNTS_ALLOCATIONS
#define LENTICULE_COUNTS_ALLOCATIONS 1
#endif

namespace {
std::atomic<long> allocations{0};
}  // namespace

#if LENTICULE_COUNTS_ALLOCATIONS
void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size == 0 ? 1 : size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
#endif
