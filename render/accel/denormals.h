// SPDX-License-Identifier: Apache-2.0
// FlushDenormals flushes denormal numbers to zero, as Embree requires in every thread that calls
// it.
#pragma once

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace lenticule::render {

/// FlushDenormals sets flush-to-zero mode on this thread during its lifetime, then restores the
/// previous mode. Worker threads do not inherit the mode, and code outside the renderer must not be
/// affected.
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
