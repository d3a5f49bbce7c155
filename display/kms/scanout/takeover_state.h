// SPDX-License-Identifier: Apache-2.0
// TakeoverState is the state that a player passes to the next one together with the card's
// descriptor, so that the last frame stays displayed and the next one needs no modeset.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <type_traits>

namespace lenticule::display {

inline constexpr int kMinScanoutBuffers = 2;
inline constexpr int kMaxScanoutBuffers = 4;

/// Plain bytes, for a sealed memory file. Object ids belong to the open descriptor, not to the
/// process that created the objects.
struct TakeoverState {
  static constexpr uint64_t kMagic = 0x3144'4e41'484c'4bff;
  static constexpr uint32_t kVersion = 2;

  uint64_t magic = kMagic;
  uint32_t version = kVersion;
  uint32_t connector = 0;
  uint32_t crtc = 0;
  uint32_t plane = 0;
  int32_t width = 0;
  int32_t height = 0;
  uint32_t buffer_count = 0;
  uint32_t off = 0;   ///< 1: the output was switched off on request
  uint32_t bits = 8;  ///< bits per colour of the buffers: 8 or 10
  uint32_t reserved = 0;
  /// The kernel's ids of a scan-out buffer, and its size.
  struct Buffer {
    uint32_t handle = 0;
    uint32_t framebuffer = 0;
    uint32_t pitch = 0;
    uint32_t reserved = 0;
    uint64_t size = 0;
    friend bool operator==(const Buffer&, const Buffer&) = default;
  };
  std::array<Buffer, kMaxScanoutBuffers> buffers{};
  std::array<char, 64> edid_sha256{};  ///< checksum of the panel's EDID, zeros if it has none
  std::array<char, 64> card{};         ///< path of the card's node, zero-terminated

  friend bool operator==(const TakeoverState&, const TakeoverState&) = default;
};
static_assert(std::is_trivially_copyable_v<TakeoverState>);

/// Returns the state; none unless the bytes are a state of this version and every number is
/// plausible.
[[nodiscard]] std::optional<TakeoverState> parse_takeover_state(std::span<const uint8_t> bytes);
[[nodiscard]] std::span<const uint8_t> bytes_of(const TakeoverState& state);

/// Frees every buffer in the state, if the state is not taken over.
void discard_buffers(int fd, const TakeoverState& state) noexcept;

}  // namespace lenticule::display
