// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/takeover_state.h"

#include <algorithm>
#include <cstring>

#include "display/kms/device/drm_handles.h"
#include "optics/rig.h"

namespace lenticule::display {
namespace {

bool plausible(const TakeoverState& state) {
  const auto side = [](int32_t pixels) { return pixels >= 1 && pixels <= optics::kMaxPanelPixels; };
  if (!side(state.width) || !side(state.height)) return false;
  if (state.buffer_count < kMinScanoutBuffers || state.buffer_count > kMaxScanoutBuffers)
    return false;
  if (state.bits != 8 && state.bits != 10) return false;
  if (state.connector == 0 || state.crtc == 0 || state.plane == 0) return false;
  if (std::find(state.card.begin(), state.card.end(), '\0') == state.card.end()) return false;
  return std::all_of(state.buffers.begin(), state.buffers.begin() + state.buffer_count,
                     [&](const TakeoverState::Buffer& buffer) {
                       const uint64_t row = uint64_t{4} * static_cast<uint64_t>(state.width);
                       constexpr uint64_t kMostBytes = uint64_t{1} << 33;
                       return buffer.handle != 0 && buffer.framebuffer != 0 &&
                              buffer.pitch >= row && buffer.size <= kMostBytes &&
                              buffer.size >=
                                  uint64_t{buffer.pitch} * static_cast<uint64_t>(state.height);
                     });
}

}  // namespace

std::optional<TakeoverState> parse_takeover_state(std::span<const uint8_t> bytes) {
  TakeoverState state;
  if (bytes.size() != sizeof(state)) return std::nullopt;
  std::memcpy(&state, bytes.data(), sizeof(state));
  if (state.magic != TakeoverState::kMagic || state.version != TakeoverState::kVersion)
    return std::nullopt;
  if (!plausible(state)) return std::nullopt;
  return state;
}

std::span<const uint8_t> bytes_of(const TakeoverState& state) {
  return {reinterpret_cast<const uint8_t*>(&state), sizeof(state)};
}

void discard_buffers(int fd, const TakeoverState& state) noexcept {
  for (uint32_t i = 0; i < std::min<uint32_t>(state.buffer_count, kMaxScanoutBuffers); ++i) {
    drmModeRmFB(fd, state.buffers[i].framebuffer);
    drmModeDestroyDumbBuffer(fd, state.buffers[i].handle);
  }
}

}  // namespace lenticule::display
