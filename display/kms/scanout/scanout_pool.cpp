// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/scanout_pool.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "display/kms/device/drm_format.h"

namespace lenticule::display {
namespace {

constexpr uint32_t kBitsPerPixel = 32;

[[noreturn]] void fail(const char* what, int error) {
  throw Error(ErrorKind::Failed,
              fmt::format("kms: cannot {} a scan-out buffer: {}", what, std::strerror(error)),
              "use fewer buffers, or give the card more memory");
}

bool holds(frames::FrameGeometry geometry, uint32_t pitch, uint64_t size) {
  const auto width = static_cast<uint64_t>(geometry.width);
  const auto height = static_cast<uint64_t>(geometry.height);
  return pitch % sizeof(uint32_t) == 0 && pitch >= width * sizeof(uint32_t) &&
         size >= uint64_t{pitch} * height;
}

FramebufferId add_framebuffer(int fd, const ScanoutLayout& layout, uint32_t handle,
                              uint32_t pitch) {
  const uint32_t handles[4] = {handle};
  const uint32_t pitches[4] = {pitch};
  const uint32_t offsets[4] = {};
  uint32_t id = 0;
  const int error = drmModeAddFB2(fd, static_cast<uint32_t>(layout.geometry.width),
                                  static_cast<uint32_t>(layout.geometry.height),
                                  drm_format(layout.depth), handles, pitches, offsets, &id, 0);
  if (error != 0) fail("register", -error);
  return {fd, id};
}

ScanoutMapping map_buffer(int fd, const std::shared_ptr<KmsPlatform>& platform, uint32_t handle,
                          uint64_t size) {
  uint64_t offset = 0;
  if (const int error = drmModeMapDumbBuffer(fd, handle, &offset); error != 0) fail("map", -error);
  void* const memory = platform->map(fd, offset, size);
  if (memory == nullptr) fail("map", errno);
  return {platform, memory, size};
}

}  // namespace

ScanoutMapping::ScanoutMapping(std::shared_ptr<KmsPlatform> platform, void* memory, size_t size)
    : platform_(std::move(platform)), memory_(memory), size_(size) {}

ScanoutMapping::ScanoutMapping(ScanoutMapping&& other) noexcept
    : platform_(std::move(other.platform_)),
      memory_(std::exchange(other.memory_, nullptr)),
      size_(std::exchange(other.size_, 0)) {}

ScanoutMapping& ScanoutMapping::operator=(ScanoutMapping&& other) noexcept {
  std::swap(platform_, other.platform_);
  std::swap(memory_, other.memory_);
  std::swap(size_, other.size_);
  return *this;
}

ScanoutMapping::~ScanoutMapping() {
  if (memory_ != nullptr) platform_->unmap(memory_, size_);
}

KmsBuffer::KmsBuffer(int fd, std::shared_ptr<KmsPlatform> platform, const ScanoutLayout& layout)
    : layout_(layout) {
  const frames::FrameGeometry& geometry = layout.geometry;
  uint32_t handle = 0;
  const int error = drmModeCreateDumbBuffer(fd, static_cast<uint32_t>(geometry.width),
                                            static_cast<uint32_t>(geometry.height), kBitsPerPixel,
                                            0, &handle, &pitch_, &size_);
  if (error != 0) fail("create", -error);
  handle_ = DumbHandle(fd, handle);
  if (!holds(geometry, pitch_, size_)) fail("use", EINVAL);
  framebuffer_ = add_framebuffer(fd, layout, handle, pitch_);
  mapping_ = map_buffer(fd, platform, handle, size_);
  // Clears old contents of other programs, and touches every page so that no page fault delays a
  // frame.
  std::memset(mapping_.data(), 0, size_);
}

KmsBuffer::KmsBuffer(int fd, std::shared_ptr<KmsPlatform> platform, const ScanoutLayout& layout,
                     const TakeoverState::Buffer& buffer)
    : layout_(layout), pitch_(buffer.pitch), size_(buffer.size) {
  if (!holds(layout.geometry, pitch_, size_)) fail("take over", EINVAL);
  mapping_ = map_buffer(fd, platform, buffer.handle, size_);
  handle_ = DumbHandle(fd, buffer.handle);
  framebuffer_ = FramebufferId(fd, buffer.framebuffer);
}

void KmsBuffer::fill(const frames::FrameView& frame) noexcept {
  LENTICULE_CHECK(layout_.takes(frame));
  expand_frame(layout_, frame, reinterpret_cast<uint32_t*>(mapping_.data()),
               pitch_ / sizeof(uint32_t));
}

bool KmsBuffer::try_acquire() noexcept {
  ScanoutState expected = ScanoutState::Free;
  return state_.compare_exchange_strong(expected, ScanoutState::Acquired,
                                        std::memory_order_acq_rel);
}

TakeoverState::Buffer KmsBuffer::takeover_buffer() const {
  return {
      .handle = handle_.get(), .framebuffer = framebuffer_.get(), .pitch = pitch_, .size = size_};
}

void KmsBuffer::abandon() noexcept {
  handle_.abandon();
  framebuffer_.abandon();
}

ScanoutPool make_scanout_pool(int fd, const std::shared_ptr<KmsPlatform>& platform,
                              const ScanoutLayout& layout, int count) {
  ScanoutPool pool;
  while (static_cast<int>(pool.size()) <
         std::clamp(count, kMinScanoutBuffers, kMaxScanoutBuffers)) {
    try {
      pool.push_back(std::make_unique<KmsBuffer>(fd, platform, layout));
    } catch (const Error&) {
      if (static_cast<int>(pool.size()) < kMinScanoutBuffers) throw;
      break;
    }
  }
  return pool;
}

}  // namespace lenticule::display
