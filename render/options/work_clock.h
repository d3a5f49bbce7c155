// SPDX-License-Identifier: Apache-2.0
// WorkClock attributes a frame's time to kinds of work, for `lenticule bench exact`.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#if defined(__x86_64__)
#include <x86intrin.h>
#endif

namespace lenticule::render {

/// Kinds of work of a worker thread.
enum class Work : uint8_t {
  MakeRays,        ///< optics: from subpixels to ray packets
  TracePrimary,    ///< Embree
  Shade,           ///< surfaces, lights, new rays
  TraceShadows,    ///< Embree
  TraceSecondary,  ///< Embree: mirrored and refracted rays
  Write,           ///< conversion of light to bytes
  Idle,
};
inline constexpr size_t kWorks = static_cast<size_t>(Work::Idle) + 1;

/// WorkClock measures the work of one thread. If enabled, it reads the processor's time stamp
/// counter at each change of work, which costs a few nanoseconds.
class WorkClock {
 public:
  explicit WorkClock(bool on) : on_(on), last_(on ? now() : 0) {}

  void turn_to(Work work) {
    if (!on_) return;
    const uint64_t time = now();
    ticks_[static_cast<size_t>(current_)] += time - last_;
    last_ = time;
    current_ = work;
  }
  /// Returns the time per kind of work in ticks of unspecified length; only their ratios are
  /// meaningful.
  [[nodiscard]] const std::array<uint64_t, kWorks>& ticks() const { return ticks_; }

 private:
  static uint64_t now() {
#if defined(__x86_64__)
    return __rdtsc();
#else
    return static_cast<uint64_t>(std::chrono::steady_clock::now().time_since_epoch().count());
#endif
  }

  bool on_;
  uint64_t last_;
  Work current_ = Work::Idle;
  std::array<uint64_t, kWorks> ticks_{};
};

}  // namespace lenticule::render
