// SPDX-License-Identifier: Apache-2.0
// The messages on the ring's Unix socket: fixed sizes, one per packet, every field checked. Both
// ends run on one machine, so numbers have native byte order; kMessageMagic detects another order.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "base/unique_fd.h"
#include "frames/ring/ring_layout.h"
#include "frames/ring/ring_renderer.h"

namespace lenticule::frames {

inline constexpr uint32_t kMessageMagic = 0x474e524cu;  // "LRNG" on a little-endian machine
inline constexpr uint32_t kProtocolVersion = 1;

enum class MessageKind : uint32_t {
  Hello = 1,    ///< renderer -> player, first
  Accept = 2,   ///< player -> renderer, with the memory and the eventfd
  Refuse = 3,   ///< player -> renderer, then the player closes
  Wanted = 4,   ///< renderer -> player: all slots are in use, send Freed when one is free
  Freed = 5,    ///< player -> renderer: a slot became free
  Goodbye = 6,  ///< renderer -> player: the sequence is complete
};

enum class RefuseReason : uint32_t {
  Busy = 1,          ///< another renderer is connected; the renderer may retry
  OtherVersion = 2,  ///< the protocol versions differ
  BadHello = 3,      ///< a field is invalid
  Forbidden = 4,     ///< another user, or a process that the player cannot watch
  OtherRig = 5,      ///< the frames are for another rig
};

struct MessagePrefix {
  uint32_t magic = kMessageMagic;
  uint32_t version = kProtocolVersion;
  MessageKind kind{};
  uint32_t bytes = 0;  ///< size of the whole message
};

struct HelloMessage {
  MessagePrefix prefix;
  char name[64] = {};
  char rig_fingerprint[128] = {};
  int64_t rate_numerator = 0;  ///< 0/0 = no rate stated
  int64_t rate_denominator = 0;
  uint64_t frame_count = 0;
  uint32_t has_frame_count = 0;  ///< 0 or 1
  uint32_t reserved = 0;
};

struct AcceptMessage {
  MessagePrefix prefix;
  uint64_t memory_bytes = 0;
  Epoch epoch = 0;
  uint32_t reserved = 0;
};

struct RefuseMessage {
  MessagePrefix prefix;
  RefuseReason reason{};
  uint32_t reserved = 0;
  char text[232] = {};
};

struct WakeMessage {  ///< Wanted and Freed
  MessagePrefix prefix;
};

struct GoodbyeMessage {
  MessagePrefix prefix;
  uint64_t published = 0;  ///< number of frames in this connection
};

inline constexpr size_t kMaxMessageBytes = 256;
static_assert(sizeof(MessagePrefix) == 16 && sizeof(HelloMessage) == 240);
static_assert(sizeof(AcceptMessage) == 32 && sizeof(RefuseMessage) == 256);
static_assert(sizeof(WakeMessage) == 16 && sizeof(GoodbyeMessage) == 24);

/// Fills in all fields of `hello`. Throws Error(Usage) that names a field that does not fit.
[[nodiscard]] HelloMessage make_hello(const RendererHello& hello);
/// Makes a Refuse message; text that is too long is cut.
[[nodiscard]] RefuseMessage make_refuse(RefuseReason reason, std::string_view text);
[[nodiscard]] AcceptMessage make_accept(uint64_t memory_bytes, Epoch epoch);
[[nodiscard]] WakeMessage make_wake(MessageKind kind);
[[nodiscard]] GoodbyeMessage make_goodbye(uint64_t published);

/// Check and parse the messages of the peer. Each read_ function sets its result and returns
/// nullptr, or returns the reason why the bytes are not such a message. Any bytes are safe.
[[nodiscard]] const char* read_prefix(std::span<const uint8_t> bytes, MessagePrefix& prefix);
[[nodiscard]] const char* read_hello(std::span<const uint8_t> bytes, RendererHello& hello);
[[nodiscard]] const char* read_accept(std::span<const uint8_t> bytes, AcceptMessage& accept);
[[nodiscard]] const char* read_refuse(std::span<const uint8_t> bytes, RefuseReason& reason,
                                      std::string& text);
[[nodiscard]] const char* read_goodbye(std::span<const uint8_t> bytes, uint64_t& published);

/// Transfer is the result of a non-blocking send or receive.
enum class Transfer { Done, WouldBlock, Closed };

struct Packet {
  std::array<uint8_t, kMaxMessageBytes + 1>
      buffer;  ///< one byte longer than any message, so that longer packets are detected
  size_t size = 0;
  std::array<UniqueFd, 2> fds;

  [[nodiscard]] std::span<const uint8_t> bytes() const { return {buffer.data(), size}; }
};

/// Sends one packet. Never blocks, never raises SIGPIPE.
[[nodiscard]] Transfer send_bytes(int socket, std::span<const uint8_t> bytes,
                                  std::span<const int> fds = {}) noexcept;
template <typename Message>
requires std::is_trivially_copyable_v<Message>
[[nodiscard]] Transfer send_message(int socket, const Message& message,
                                    std::span<const int> fds = {}) noexcept {
  return send_bytes(socket, {reinterpret_cast<const uint8_t*>(&message), sizeof message}, fds);
}

/// PassedFds decides whether received descriptors are taken; the kernel closes the others.
enum class PassedFds { Take, Ignore };
/// Receives one packet without blocking. Returns Closed once no packet is left and the peer has
/// closed.
[[nodiscard]] Transfer receive_packet(int socket, Packet& packet, PassedFds passed) noexcept;

}  // namespace lenticule::frames
