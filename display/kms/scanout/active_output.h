// SPDX-License-Identifier: Apache-2.0
// ActiveOutput is an output that shows frames, with its scan-out buffers. It is opened by taking
// over the buffers or the mode of the previous user of the card, or by a modeset.
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "display/display.h"
#include "display/kms/device/drm_properties.h"
#include "display/kms/device/platform.h"
#include "display/kms/scanout/kms_display.h"
#include "display/kms/scanout/kms_output.h"
#include "display/scanout_format.h"

namespace lenticule::display {

enum class ScanoutState { Free, Acquired, Pending, Displayed };

struct ScanoutUnmap {
  std::shared_ptr<KmsPlatform> platform;
  size_t size = 0;
  void operator()(void* memory) const noexcept { platform->unmap(memory, size); }
};
/// ScanoutMapping owns the memory mapping of a scan-out buffer.
using ScanoutMapping = std::unique_ptr<void, ScanoutUnmap>;

class KmsBuffer final : public ScanoutBuffer {
 public:
  /// Creates a buffer and fills it with black, which touches every page. Throws Error(Failed) if
  /// the card or the system has no memory for it; frees everything that was created before the
  /// failure.
  KmsBuffer(int fd, std::shared_ptr<KmsPlatform> platform, const ScanoutLayout& layout);
  /// Wraps a buffer that another process created, keeping its contents. Takes ownership of the ids
  /// only on success.
  KmsBuffer(int fd, std::shared_ptr<KmsPlatform> platform, const ScanoutLayout& layout,
            const TakeoverState::Buffer& buffer);

  void fill(const frames::FrameView& frame) noexcept override;

  /// Changes Free to Acquired; returns false if the buffer is not free. The filling thread's only
  /// transition.
  [[nodiscard]] bool try_acquire() noexcept;
  void set_state(ScanoutState state) noexcept { state_.store(state, std::memory_order_release); }
  [[nodiscard]] ScanoutState state() const noexcept {
    return state_.load(std::memory_order_acquire);
  }
  [[nodiscard]] uint32_t framebuffer() const { return framebuffer_.get(); }
  /// Returns the ids with which another process can take over the buffer.
  [[nodiscard]] TakeoverState::Buffer takeover_buffer() const;
  /// Unmaps the buffer, and leaves contents and ids to the process that holds the card's
  /// descriptor.
  void abandon() noexcept;

 private:
  ScanoutLayout layout_;
  uint32_t pitch_ = 0;
  uint64_t size_ = 0;
  DumbHandle handle_;          // destroyed third
  FramebufferId framebuffer_;  // destroyed second: the framebuffer on the handle
  ScanoutMapping mapping_;     // destroyed first: the mapping of the handle
  std::atomic<ScanoutState> state_{ScanoutState::Free};
};

/// ScanoutPool holds the dumb buffers that the card scans out, each with the state of its use.
using ScanoutPool = std::vector<std::unique_ptr<KmsBuffer>>;

/// Creates up to `count` buffers, as many as there is memory for. Throws Error(Failed) if fewer
/// than two.
[[nodiscard]] ScanoutPool make_scanout_pool(int fd, const std::shared_ptr<KmsPlatform>& platform,
                                            const ScanoutLayout& layout, int count);

/// ActiveOutput is an output that shows frames, with its scan-out buffers. It is opened by taking
/// over the buffers or the mode of the previous user of the card, or by a modeset.
struct ActiveOutput {
  std::unique_ptr<KmsOutput> output;
  ScanoutPool buffers;         ///< released before the output
  KmsBuffer* front = nullptr;  ///< the displayed buffer
};

/// Opens the requested output. All services in `options` must be set. Takes over
/// `options.previous`; if any part of its state does not match, frees its buffers and finds
/// connector, mode and CRTC itself. Throws as open_kms_display().
[[nodiscard]] ActiveOutput open_output(const KmsOptions& options);

/// Throws Error(Quality) if the output is known to change subpixels and that is not allowed.
void require_exact(const KmsOptions& options, const KmsOutput& output);

/// Describes the output for the next player.
[[nodiscard]] TakeoverState takeover_state_of(const ActiveOutput& active,
                                              frames::FrameGeometry geometry);

}  // namespace lenticule::display
