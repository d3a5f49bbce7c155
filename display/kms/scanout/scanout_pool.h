// SPDX-License-Identifier: Apache-2.0
// Dumb buffers that the card scans out, and who has each of them at the moment.
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "display/display.h"
#include "display/kms/device/drm_handles.h"
#include "display/kms/device/platform.h"
#include "display/kms/scanout/handover.h"

namespace lenticule::display {

enum class ScanoutState { Free, Acquired, Pending, OnGlass };

/// Memory that was mapped, and the way to unmap it.
class ScanoutMapping {
 public:
  ScanoutMapping() = default;
  ScanoutMapping(std::shared_ptr<KmsPlatform> platform, void* memory, size_t size);
  ScanoutMapping(ScanoutMapping&& other) noexcept;
  ScanoutMapping& operator=(ScanoutMapping&& other) noexcept;
  ~ScanoutMapping();

  [[nodiscard]] uint8_t* data() const { return static_cast<uint8_t*>(memory_); }
  [[nodiscard]] size_t size() const { return size_; }

 private:
  std::shared_ptr<KmsPlatform> platform_;
  void* memory_ = nullptr;
  size_t size_ = 0;
};

/// The kernel's names of one buffer, as another process may inherit them.
struct ScanoutNames {
  uint32_t handle = 0;
  uint32_t framebuffer = 0;
  uint32_t pitch = 0;
  uint64_t size = 0;
};

class KmsBuffer final : public ScanoutBuffer {
 public:
  /// New and black, every page touched. Throws Error(Failed) when the card or the system has no
  /// memory for it; nothing half-made stays behind.
  KmsBuffer(int fd, std::shared_ptr<KmsPlatform> platform, frames::FrameGeometry geometry);
  /// One that another process made; its picture stays. Takes the names over only on success.
  KmsBuffer(int fd, std::shared_ptr<KmsPlatform> platform, frames::FrameGeometry geometry,
            const ScanoutNames& names);

  void fill(const frames::FrameView& frame) noexcept override;

  /// Free -> Acquired; false if it is not free. The filling thread's only transition.
  [[nodiscard]] bool try_acquire() noexcept;
  void set_state(ScanoutState state) noexcept { state_.store(state, std::memory_order_release); }
  [[nodiscard]] ScanoutState state() const noexcept {
    return state_.load(std::memory_order_acquire);
  }
  [[nodiscard]] uint32_t framebuffer() const { return framebuffer_.get(); }
  [[nodiscard]] ScanoutNames names() const;
  /// Unmaps, but leaves picture and names to whoever holds the card's descriptor.
  void abandon() noexcept;

 private:
  frames::FrameGeometry geometry_;
  uint32_t pitch_ = 0;
  uint64_t size_ = 0;
  DumbHandle handle_;          // released after
  FramebufferId framebuffer_;  // the framebuffer on it, and that after
  ScanoutMapping mapping_;     // its mapping
  std::atomic<ScanoutState> state_{ScanoutState::Free};
};

using ScanoutPool = std::vector<std::unique_ptr<KmsBuffer>>;

/// As many as there is memory for, up to `count`. Throws Error(Failed) below two.
[[nodiscard]] ScanoutPool make_scanout_pool(int fd, const std::shared_ptr<KmsPlatform>& platform,
                                            frames::FrameGeometry geometry, int count);

}  // namespace lenticule::display
