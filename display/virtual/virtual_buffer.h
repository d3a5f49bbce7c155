// SPDX-License-Identifier: Apache-2.0
// VirtualBuffer is a scan-out buffer in ordinary memory, with the state of its use.
#pragma once

#include <atomic>
#include <cstdlib>
#include <memory>

#include "display/display.h"
#include "display/scanout_layout.h"
#include "display/scanout_recorder.h"

namespace lenticule::display {

enum class BufferState { Free, Acquired, Pending, Displayed };

/// A buffer that is being recorded is not free, even in state Free. Thread safety: the filling
/// thread acquires it; the presenter thread makes all other transitions.
class VirtualBuffer final : public ScanoutBuffer {
 public:
  /// Fills the buffer with black, which touches every page, so that page faults cannot delay a
  /// frame.
  explicit VirtualBuffer(const ScanoutLayout& layout);

  void fill(const frames::FrameView& frame) noexcept override;

  /// Changes Free to Acquired; returns false if the buffer is not free.
  [[nodiscard]] bool try_acquire() noexcept;
  void set_state(BufferState state) noexcept { state_.store(state, std::memory_order_release); }
  [[nodiscard]] BufferState state() const noexcept {
    return state_.load(std::memory_order_acquire);
  }

  void begin_recording() noexcept { recording_.store(true, std::memory_order_relaxed); }
  void end_recording() noexcept { recording_.store(false, std::memory_order_release); }
  [[nodiscard]] ScanoutView view() const noexcept {
    return {words_.get(), stride_, layout_.geometry, layout_.depth};
  }

  /// Returns the bytes of one buffer of this size.
  [[nodiscard]] static size_t bytes(frames::FrameGeometry geometry) noexcept;

 private:
  struct FreeMemory {
    void operator()(uint32_t* words) const noexcept { std::free(words); }
  };

  ScanoutLayout layout_;
  size_t stride_;
  std::unique_ptr<uint32_t, FreeMemory> words_;
  std::atomic<BufferState> state_{BufferState::Free};
  std::atomic<bool> recording_{false};
};

}  // namespace lenticule::display
