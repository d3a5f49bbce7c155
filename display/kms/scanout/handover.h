// SPDX-License-Identifier: Apache-2.0
// What a player leaves to the next one, beside the card's descriptor, so that the last frame stays
// on the glass and the next is flipped without a modeset.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <type_traits>

namespace lenticule::display {

inline constexpr int kMinScanoutBuffers = 2;
inline constexpr int kMaxScanoutBuffers = 4;

/// Plain bytes, for a sealed memory file. Object names belong to the open descriptor, not to the
/// process that made them.
struct HandoverState {
  static constexpr uint64_t kMagic = 0x3144'4e41'484c'4bff;
  static constexpr uint32_t kVersion = 1;

  uint64_t magic = kMagic;
  uint32_t version = kVersion;
  uint32_t connector = 0;
  uint32_t crtc = 0;
  uint32_t plane = 0;
  int32_t width = 0;
  int32_t height = 0;
  uint32_t buffer_count = 0;
  uint32_t reserved = 0;
  struct Buffer {
    uint32_t handle = 0;
    uint32_t framebuffer = 0;
    uint32_t pitch = 0;
    uint32_t reserved = 0;
    uint64_t size = 0;
    friend bool operator==(const Buffer&, const Buffer&) = default;
  };
  std::array<Buffer, kMaxScanoutBuffers> buffers{};
  std::array<char, 64> edid_sha256{};  ///< of the panel, zeros if it has none
  std::array<char, 64> card{};         ///< path of the node, ends with a zero

  friend bool operator==(const HandoverState&, const HandoverState&) = default;
};
static_assert(std::is_trivially_copyable_v<HandoverState>);

/// None unless the bytes are a state of this version whose every number is plausible.
[[nodiscard]] std::optional<HandoverState> parse_handover(std::span<const uint8_t> bytes);
[[nodiscard]] std::span<const uint8_t> handover_bytes(const HandoverState& state);

/// Frees every buffer that the state names: for a state that is not taken over.
void discard_buffers(int fd, const HandoverState& state) noexcept;

}  // namespace lenticule::display
