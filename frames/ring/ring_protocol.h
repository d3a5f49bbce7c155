// SPDX-License-Identifier: Apache-2.0
// The messages on the ring's Unix socket: fixed sizes, one per packet, every field checked. Both
// ends run on one machine, so numbers have native byte order; kMessageMagic detects another order.
#pragma once

#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "base/error.h"
#include "base/unique_fd.h"
#include "frames/rational.h"
#include "frames/ring/ring_layout.h"

namespace lenticule::frames {

struct RendererHello {
  std::string name = "lenticule";  ///< name in the player's log
  std::string rig_fingerprint;     ///< empty = not stated, which a player with a rig refuses
  std::optional<Rate> rate;        ///< content rate
  std::optional<uint64_t> frame_count;
  bool views = false;  ///< pushes views or a view with its depth, as RingContent asks for
};

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
  uint32_t views = 0;            ///< 0 or 1; players of earlier versions refuse 1
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

static_assert(sizeof(WakeMessage) == 16 && sizeof(GoodbyeMessage) == 24);

static_assert(sizeof(AcceptMessage) == 32 && sizeof(RefuseMessage) == 256);

static_assert(sizeof(MessagePrefix) == 16 && sizeof(HelloMessage) == 240);

template <typename Message>
Message make(MessageKind kind) {
  Message message;
  message.prefix.kind = kind;
  message.prefix.bytes = sizeof(Message);
  return message;
}

/// Rejects control characters, which would let a peer write into our log or terminal.
inline bool is_printable(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) {
    const auto code = static_cast<unsigned char>(c);
    return code >= 0x20 && code != 0x7f;
  });
}

template <size_t N>
void write_field(const std::string& text, const char* what, char (&field)[N]) {
  if (text.size() >= N || !is_printable(text))
    throw Error(ErrorKind::Usage, std::string("ring: ") + what + " is too long or not plain text",
                "use fewer than " + std::to_string(N) + " printable bytes");
  std::memcpy(field, text.data(), text.size());
}

inline bool is_sensible_rate(int64_t numerator, int64_t denominator) {
  constexpr int64_t kMaxHertz = 10000, kMaxSecondsPerFrame = 3600;
  constexpr int64_t kMaxRateTerm = int64_t{1} << 40;  // products below stay within 64 bits
  if (numerator <= 0 || denominator <= 0) return false;
  if (numerator > kMaxRateTerm || denominator > kMaxRateTerm) return false;
  return numerator <= kMaxHertz * denominator && denominator <= kMaxSecondsPerFrame * numerator;
}

/// Fills in all fields of `hello`. Throws Error(Usage) that names a field that does not fit.
[[nodiscard]] inline HelloMessage make_hello(const RendererHello& hello) {
  auto message = make<HelloMessage>(MessageKind::Hello);
  write_field(hello.name, "the renderer's name", message.name);
  write_field(hello.rig_fingerprint, "the rig's fingerprint", message.rig_fingerprint);
  if (hello.rate) {
    if (!is_sensible_rate(hello.rate->numerator, hello.rate->denominator))
      throw Error(ErrorKind::Usage, "ring: the frame rate is out of range",
                  "use 1/3600 ... 10000 frames per second");
    message.rate_numerator = hello.rate->numerator;
    message.rate_denominator = hello.rate->denominator;
  }
  message.has_frame_count = hello.frame_count.has_value() ? 1 : 0;
  message.frame_count = hello.frame_count.value_or(0);
  message.views = hello.views ? 1 : 0;
  return message;
}

/// Makes a Refuse message; text that is too long is cut.
[[nodiscard]] inline RefuseMessage make_refuse(RefuseReason reason, std::string_view text) {
  auto message = make<RefuseMessage>(MessageKind::Refuse);
  message.reason = reason;
  std::memcpy(message.text, text.data(), std::min(text.size(), sizeof message.text - 1));
  return message;
}

[[nodiscard]] inline AcceptMessage make_accept(uint64_t memory_bytes, Epoch epoch) {
  auto message = make<AcceptMessage>(MessageKind::Accept);
  message.memory_bytes = memory_bytes;
  message.epoch = epoch;
  return message;
}

[[nodiscard]] inline WakeMessage make_wake(MessageKind kind) { return make<WakeMessage>(kind); }

[[nodiscard]] inline GoodbyeMessage make_goodbye(uint64_t published) {
  auto message = make<GoodbyeMessage>(MessageKind::Goodbye);
  message.published = published;
  return message;
}

/// Check and parse the messages of the peer. Each read_ function sets its result and returns
/// nullptr, or returns the reason why the bytes are not such a message. Any bytes are safe.
[[nodiscard]] inline const char* read_prefix(std::span<const uint8_t> bytes,
                                             MessagePrefix& prefix) {
  if (bytes.size() < sizeof prefix) return "too short";
  std::memcpy(&prefix, bytes.data(), sizeof prefix);
  if (prefix.magic != kMessageMagic) return "not a ring message";
  if (prefix.version != kProtocolVersion) return "another protocol version";
  if (prefix.bytes != bytes.size()) return "wrong length";
  return nullptr;
}

/// Returns the text of a field, which must contain its terminating zero.
template <size_t N>
std::optional<std::string> read_field(const char (&field)[N]) {
  const char* end = std::find(field, field + N, '\0');
  if (end == field + N || !is_printable({field, end})) return std::nullopt;
  return std::string(field, end);
}

template <typename Message>
const char* read_message(std::span<const uint8_t> bytes, MessageKind kind, Message& message) {
  MessagePrefix prefix;
  if (const char* problem = read_prefix(bytes, prefix)) return problem;
  if (prefix.kind != kind) return "unexpected message";
  if (bytes.size() != sizeof message) return "wrong length";
  std::memcpy(static_cast<void*>(&message), bytes.data(), sizeof message);
  return nullptr;
}

[[nodiscard]] inline const char* read_hello(std::span<const uint8_t> bytes, RendererHello& hello) {
  HelloMessage message;
  if (const char* problem = read_message(bytes, MessageKind::Hello, message)) return problem;
  const auto name = read_field(message.name);
  const auto fingerprint = read_field(message.rig_fingerprint);
  if (!name) return "the name is not plain text";
  if (!fingerprint) return "the rig's fingerprint is not plain text";
  if (message.has_frame_count > 1 || message.views > 1) return "a reserved field is in use";

  RendererHello checked = {.name = *name,
                           .rig_fingerprint = *fingerprint,
                           .rate = {},
                           .frame_count = {},
                           .views = message.views == 1};
  if (message.rate_numerator != 0 || message.rate_denominator != 0) {
    if (!is_sensible_rate(message.rate_numerator, message.rate_denominator))
      return "the frame rate is out of range";
    const int64_t divisor = std::gcd(message.rate_numerator, message.rate_denominator);
    checked.rate = Rate{message.rate_numerator / divisor, message.rate_denominator / divisor};
  }
  if (message.has_frame_count == 1) checked.frame_count = message.frame_count;
  hello = std::move(checked);
  return nullptr;
}

[[nodiscard]] inline const char* read_accept(std::span<const uint8_t> bytes,
                                             AcceptMessage& accept) {
  AcceptMessage message;
  if (const char* problem = read_message(bytes, MessageKind::Accept, message)) return problem;
  if (message.epoch == 0 || message.epoch > kMaxEpoch) return "the epoch is out of range";
  if (message.reserved != 0) return "a reserved field is in use";
  accept = message;
  return nullptr;
}

[[nodiscard]] inline const char* read_refuse(std::span<const uint8_t> bytes, RefuseReason& reason,
                                             std::string& text) {
  // A player of another version refuses in its own version, so only this message must keep its form
  // in all versions.
  RefuseMessage message;
  if (bytes.size() != sizeof message) return "wrong length";
  std::memcpy(static_cast<void*>(&message), bytes.data(), sizeof message);
  if (message.prefix.magic != kMessageMagic || message.prefix.kind != MessageKind::Refuse)
    return "unexpected message";
  if (message.reason < RefuseReason::Busy || message.reason > RefuseReason::OtherRig)
    return "unknown reason";
  const auto checked = read_field(message.text);
  if (!checked) return "the reason is not plain text";
  reason = message.reason;
  text = *checked;
  return nullptr;
}

[[nodiscard]] inline const char* read_goodbye(std::span<const uint8_t> bytes, uint64_t& published) {
  GoodbyeMessage message;
  if (const char* problem = read_message(bytes, MessageKind::Goodbye, message)) return problem;
  published = message.published;
  return nullptr;
}

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
[[nodiscard]] inline Transfer send_bytes(int socket, std::span<const uint8_t> bytes,
                                         std::span<const int> fds = {}) noexcept {
  iovec part = {const_cast<uint8_t*>(bytes.data()), bytes.size()};
  msghdr message = {};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  alignas(cmsghdr) char control[CMSG_SPACE(2 * sizeof(int))] = {};
  if (!fds.empty()) {
    message.msg_control = control;
    message.msg_controllen = CMSG_SPACE(fds.size_bytes());
    cmsghdr* rights = CMSG_FIRSTHDR(&message);
    rights->cmsg_level = SOL_SOCKET;
    rights->cmsg_type = SCM_RIGHTS;
    rights->cmsg_len = CMSG_LEN(fds.size_bytes());
    std::memcpy(CMSG_DATA(rights), fds.data(), fds.size_bytes());
  }
  for (;;) {
    if (::sendmsg(socket, &message, MSG_DONTWAIT | MSG_NOSIGNAL) >= 0) return Transfer::Done;
    if (errno == EINTR) continue;
    return errno == EAGAIN || errno == ENOBUFS ? Transfer::WouldBlock : Transfer::Closed;
  }
}

template <typename Message>
requires std::is_trivially_copyable_v<Message>
[[nodiscard]] Transfer send_message(int socket, const Message& message,
                                    std::span<const int> fds = {}) noexcept {
  return send_bytes(socket, {reinterpret_cast<const uint8_t*>(&message), sizeof message}, fds);
}

/// PassedFds decides whether received descriptors are taken; the kernel closes the others.
enum class PassedFds { Take, Ignore };

/// Takes ownership of every received descriptor, including unexpected ones.
inline void take_fds(msghdr& message, std::array<UniqueFd, 2>& fds) noexcept {
  size_t taken = 0;
  for (cmsghdr* part = CMSG_FIRSTHDR(&message); part; part = CMSG_NXTHDR(&message, part)) {
    if (part->cmsg_level != SOL_SOCKET || part->cmsg_type != SCM_RIGHTS) continue;
    const size_t count = (part->cmsg_len - CMSG_LEN(0)) / sizeof(int);
    for (size_t i = 0; i < count; ++i) {
      int fd = -1;
      std::memcpy(&fd, CMSG_DATA(part) + i * sizeof fd, sizeof fd);
      UniqueFd owned(fd);
      if (taken < fds.size()) fds[taken++] = std::move(owned);
    }
  }
}

/// Receives one packet without blocking. Returns Closed once no packet is left and the peer has
/// closed.
[[nodiscard]] inline Transfer receive_packet(int socket, Packet& packet,
                                             PassedFds passed) noexcept {
  iovec part = {packet.buffer.data(), packet.buffer.size()};
  alignas(cmsghdr) char control[CMSG_SPACE(2 * sizeof(int))];
  // If a peer closes with unread messages in its queue, our next read fails once with ECONNRESET,
  // before the messages that the peer had sent. These messages still count, so reading continues
  // until the queue is empty.
  for (int resets = 0; resets < 2;) {
    msghdr message = {};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = passed == PassedFds::Take ? control : nullptr;
    message.msg_controllen = passed == PassedFds::Take ? sizeof control : 0;
    const ssize_t received = ::recvmsg(socket, &message, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
    if (received >= 0) {
      packet.size = static_cast<size_t>(received);
      packet.fds = {};
      if (passed == PassedFds::Take) take_fds(message, packet.fds);
      return received == 0 ? Transfer::Closed : Transfer::Done;
    }
    if (errno == EAGAIN) return Transfer::WouldBlock;
    if (errno != EINTR) ++resets;
  }
  return Transfer::Closed;
}

}  // namespace lenticule::frames
