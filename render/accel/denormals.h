// SPDX-License-Identifier: Apache-2.0
// Flushing of denormal numbers, which Embree asks for in every thread that calls it.
#pragma once

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace lenticule::render {

/// Flushes denormals to zero on this thread while it lives, then restores what was before: worker
/// threads do not inherit the mode, and code outside the renderer must not notice it.
class FlushDenormals {
 public:
#if defined(__SSE2__)
  FlushDenormals() : before_(_mm_getcsr()) {
    _mm_setcsr(before_ | kFlushToZero | kZeroIfDenormal);
  }
  ~FlushDenormals() {
    _mm_setcsr(before_);
  }
#else
  FlushDenormals() = default;
  ~FlushDenormals() = default;
#endif
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
#if defined(__SSE2__)
  static constexpr unsigned kFlushToZero = 0x8000;
  static constexpr unsigned kZeroIfDenormal = 0x0040;
  unsigned before_;
#endif
};

}  // namespace lenticule::render
