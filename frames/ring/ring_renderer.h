// SPDX-License-Identifier: Apache-2.0
// RingRenderer is the renderer's end of the ring: it connects to a player and writes frames into
// its slots.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <thread>

#include "base/error.h"
#include "base/unique_fd.h"
#include "base/unix_address.h"
#include "frames/frame.h"
#include "frames/ring/listen_socket.h"
#include "frames/ring/ring_layout.h"
#include "frames/ring/ring_protocol.h"

namespace lenticule::frames {

enum class RingStatus {
  Ok,
  TimedOut,  ///< no slot became free in time; call again
  Gone,      ///< the player has exited; connect again
};

/// RingAdmission holds the resources that the player granted.
struct RingAdmission {
  UniqueFd socket;
  UniqueFd memory;
  UniqueFd published;
  AcceptMessage accept;
};

/// Longest single wait for a wake-up; the table is checked after each wait.
inline constexpr std::chrono::milliseconds kMaxNap{100};
inline constexpr std::chrono::milliseconds kGoodbyeTimeout{1000};

/// Returns a time that stays representable for timeouts such as std::chrono::milliseconds::max().
inline std::chrono::steady_clock::time_point deadline_after(std::chrono::milliseconds timeout) {
  constexpr std::chrono::milliseconds kForever = std::chrono::hours(24 * 365);
  return std::chrono::steady_clock::now() +
         std::clamp(timeout, std::chrono::milliseconds(0), kForever);
}

inline std::chrono::milliseconds time_left(std::chrono::steady_clock::time_point deadline) {
  const auto left =
      std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
  return std::max(left, std::chrono::milliseconds(0));
}

inline void wait_for(int fd, short events, std::chrono::milliseconds timeout) {
  pollfd query = {.fd = fd, .events = events, .revents = 0};
  (void)::poll(&query, 1, static_cast<int>(timeout.count()));
}

// Pauses between attempts to connect: short at first, for players that are about to start, then
// longer.
inline constexpr std::chrono::milliseconds kShortestPause{1};
inline constexpr std::chrono::milliseconds kLongestPause{20};

/// Obstacle is the reason why an attempt failed that may succeed later.
struct Obstacle {
  std::string cause;
  std::string hint;
};

/// Time in which a player that runs answers.
inline constexpr std::chrono::milliseconds kTimeToAnswer{1000};

[[noreturn]] inline void throw_refusal(const std::string& path, RefuseReason reason,
                                       const std::string& text) {
  const ErrorKind kind = reason == RefuseReason::Forbidden ? ErrorKind::Device : ErrorKind::Input;
  const char* hint = reason == RefuseReason::OtherRig
                         ? "render with the rig file that the player was started with"
                         : "";
  throw Error(kind, path + ": the player refused: " + text, hint);
}

[[noreturn]] inline void throw_protocol_error(const std::string& path, const char* problem) {
  throw Error(ErrorKind::Input,
              path + ": the other end does not speak the ring protocol: " + problem);
}

/// Connects and sends Hello. Returns the player's admission, or sets an Obstacle for failures that
/// may disappear; throws for others. At first, `obstacle` is that of the attempt before.
[[nodiscard]] inline std::optional<RingAdmission> try_handshake(
    const std::string& path, const UnixAddress& address, const HelloMessage& hello,
    std::chrono::steady_clock::time_point deadline, Obstacle& obstacle) {
  UniqueFd socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!socket) throw Error(ErrorKind::Failed, path + ": " + std::strerror(errno));
  if (::connect(socket.get(), address.get(), address.bytes) != 0) {
    if (errno == EACCES || errno == EPERM || errno == EPROTOTYPE || errno == ENOTSOCK)
      throw Error(ErrorKind::Device, path + ": " + std::strerror(errno),
                  "use the socket of a player that the same user started");
    if (errno == EAGAIN) return std::nullopt;  // too many renderers are waiting already
    obstacle = {"no player listens there", "start the player first: lenticule play ring:SOCKET"};
    return std::nullopt;
  }
  if (send_message(socket.get(), hello) != Transfer::Done) return std::nullopt;
  // The last attempt may have too little time for an answer; the answer before it still holds.
  if (obstacle.cause.empty() || time_left(deadline) >= kTimeToAnswer)
    obstacle = {"the player does not answer", "check whether the player is stopped or overloaded"};
  wait_for(socket.get(), POLLIN, time_left(deadline));
  Packet packet;
  if (receive_packet(socket.get(), packet, PassedFds::Take) != Transfer::Done) return std::nullopt;
  RefuseReason reason{};
  std::string text;
  if (read_refuse(packet.bytes(), reason, text) == nullptr) {
    if (reason != RefuseReason::Busy) throw_refusal(path, reason, text);
    obstacle = {"the player is " + text, "stop the other renderer, or wait for it"};
    return std::nullopt;
  }
  RingAdmission admission;
  if (const char* problem = read_accept(packet.bytes(), admission.accept))
    throw_protocol_error(path, problem);
  if (!packet.fds[0] || !packet.fds[1]) throw_protocol_error(path, "it sent no memory");
  admission.socket = std::move(socket);
  admission.memory = std::move(packet.fds[0]);
  admission.published = std::move(packet.fds[1]);
  return admission;
}

inline RingAdmission handshake(const std::filesystem::path& path, const HelloMessage& hello,
                               std::chrono::milliseconds timeout) {
  const UnixAddress address = unix_address(path);
  const std::chrono::steady_clock::time_point deadline = deadline_after(timeout);
  Obstacle obstacle;
  for (std::chrono::milliseconds pause = kShortestPause;;
       pause = std::min(2 * pause, kLongestPause)) {
    if (auto admission = try_handshake(path.string(), address, hello, deadline, obstacle))
      return std::move(*admission);
    std::this_thread::sleep_for(std::min(pause, time_left(deadline)));
    if (std::chrono::steady_clock::now() >= deadline) break;
  }
  if (obstacle.cause.empty()) obstacle.cause = "the player does not answer";
  throw Error(ErrorKind::Device, path.string() + ": " + obstacle.cause, obstacle.hint);
}

/// Maps the whole memory, after checking that no process can shrink it.
inline Mapping map_memory(const std::string& path, const RingAdmission& admission,
                          RingLayout& layout) {
  struct stat status;
  const int fd = admission.memory.get();
  const uint64_t promised = admission.accept.memory_bytes;
  if (::fstat(fd, &status) != 0 || status.st_size < 0 ||
      static_cast<uint64_t>(status.st_size) != promised || promised < kHeaderBytes)
    throw_protocol_error(path, "the size of the memory differs from the announced one");
  const int seals = ::fcntl(fd, F_GET_SEALS);
  if (seals < 0 || (seals & F_SEAL_SHRINK) == 0)
    throw_protocol_error(path, "the memory is not sealed");
  {
    const Mapping header(fd, 0, kHeaderBytes, PROT_READ);
    if (!header) throw Error(ErrorKind::Failed, path + ": cannot map the ring");
    const auto* fields = std::launder(reinterpret_cast<const RingHeader*>(header.bytes().data()));
    if (const char* problem = read_header(*fields, promised, layout))
      throw_protocol_error(path, problem);
  }
  Mapping memory(fd, 0, layout.memory_bytes, PROT_READ | PROT_WRITE);
  if (!memory)
    throw Error(ErrorKind::Failed, path + ": cannot map the ring: " + std::strerror(errno));
  ::madvise(memory.bytes().data(), memory.bytes().size(), MADV_HUGEPAGE);  // ignored if not allowed
  return memory;
}

/// RingRenderer is one connection.
///
/// Thread safety: one thread.
class RingRenderer {
 public:
  /// Waits at most `timeout` for a player to listen. Throws Error(Device) when none does, and
  /// Error(Input) with the player's reason when the player refuses this renderer (another rig,
  /// another geometry).
  [[nodiscard]] static std::unique_ptr<RingRenderer> connect(const std::filesystem::path& socket,
                                                             const RendererHello& hello,
                                                             std::chrono::milliseconds timeout) {
    return std::unique_ptr<RingRenderer>(
        new RingRenderer(socket.string(), handshake(socket, make_hello(hello), timeout)));
  }
  ~RingRenderer() { abandon(); }
  RingRenderer(const RingRenderer&) = delete;
  RingRenderer& operator=(const RingRenderer&) = delete;

  /// Returns the geometry that the player requires.
  [[nodiscard]] FrameGeometry geometry() const { return layout_.geometry; }
  [[nodiscard]] int slots() const { return layout_.slots; }
  /// Returns what the player expects in each picture.
  [[nodiscard]] const RingContent& content() const { return layout_.content; }

  /// Acquires a free slot for frame `number`; its bytes are undefined. At most one slot at a time.
  [[nodiscard]] RingStatus acquire(uint64_t number, std::chrono::milliseconds timeout,
                                   std::span<uint8_t>& pixels) {
    LENTICULE_CHECK(!held_);
    const std::chrono::steady_clock::time_point deadline = deadline_after(timeout);
    for (;;) {
      read_messages();
      if (gone_) return RingStatus::Gone;
      beat();
      if (take_slot()) break;
      const std::chrono::milliseconds left = time_left(deadline);
      if (left == std::chrono::milliseconds(0)) return RingStatus::TimedOut;
      ask_for_slot();
      wait_for(socket_.get(), POLLIN, std::min(left, kMaxNap));
    }
    number_ = number;
    pixels = memory_.bytes().subspan(layout_.slot_offset(*held_), layout_.geometry.frame_bytes());
    return RingStatus::Ok;
  }
  /// Publishes the acquired slot. Frames are shown in the order of publishing.
  [[nodiscard]] RingStatus publish() {
    LENTICULE_CHECK(held_);
    const bool ours = publish_slot(table_[*held_], epoch_, number_, published_);
    held_.reset();
    if (!ours)
      gone_ = true;  // the player has withdrawn the slot, so it has disconnected this renderer
    read_messages();
    if (gone_) return RingStatus::Gone;
    ++published_;
    const uint64_t one = 1;
    (void)!::write(published_event_.get(), &one,
                   sizeof one);  // a full counter wakes the player too
    beat();
    return RingStatus::Ok;
  }
  /// Releases the acquired slot without publishing it.
  void abandon() {
    if (held_) abandon_slot(table_[*held_], epoch_);
    held_.reset();
  }

  /// Completes the sequence, then sends the Goodbye message.
  void finish() {
    abandon();
    const std::chrono::steady_clock::time_point deadline = deadline_after(kGoodbyeTimeout);
    while (!gone_ &&
           send_message(socket_.get(), make_goodbye(published_)) == Transfer::WouldBlock) {
      if (std::chrono::steady_clock::now() >= deadline) break;
      wait_for(socket_.get(), POLLOUT, time_left(deadline));
    }
    gone_ = true;
    socket_.reset();
  }

 private:
  RingRenderer(const std::string& path, RingAdmission admission)
      : socket_(std::move(admission.socket)),
        published_event_(std::move(admission.published)),
        epoch_(admission.accept.epoch),
        memory_(map_memory(path, admission, layout_)) {
    table_ = {reinterpret_cast<SlotEntry*>(memory_.bytes().data() + layout_.table_offset),
              static_cast<size_t>(layout_.slots)};
  }
  [[nodiscard]] bool take_slot() noexcept {
    for (int i = 0; i < layout_.slots; ++i) {
      const int slot = (cursor_ + i) % layout_.slots;
      if (!take_free_slot(table_[slot], epoch_)) continue;
      held_ = slot;
      cursor_ = (slot + 1) % layout_.slots;
      asked_ = false;
      return true;
    }
    return false;
  }
  // Reads wake-ups, which carry no data; the purpose is to detect that the player has exited.
  void read_messages() noexcept {
    Packet packet;
    Transfer transfer = Transfer::Done;
    while (transfer == Transfer::Done && !gone_)
      transfer = receive_packet(socket_.get(), packet, PassedFds::Ignore);
    if (transfer == Transfer::Closed) gone_ = true;
  }
  void beat() noexcept {
    auto* header = std::launder(reinterpret_cast<RingHeader*>(memory_.bytes().data()));
    header->heartbeat.fetch_add(1, std::memory_order_relaxed);
  }
  // Asks once per slot: the player answers as soon as one is free.
  void ask_for_slot() noexcept {
    if (asked_) return;
    asked_ = send_message(socket_.get(), make_wake(MessageKind::Wanted)) == Transfer::Done;
  }

  RingLayout layout_;
  UniqueFd socket_;
  UniqueFd published_event_;
  Epoch epoch_;
  Mapping memory_;
  std::span<SlotEntry> table_;
  std::optional<int> held_;  ///< the slot being written
  uint64_t number_ = 0;      ///< number of the frame in the slot
  uint64_t published_ = 0;
  int cursor_ =
      0;  ///< the slot after the last one taken: cyclic order keeps the player's search short
  bool asked_ = false;
  bool gone_ = false;
};

}  // namespace lenticule::frames
