// SPDX-License-Identifier: Apache-2.0
#include "frames/ring/ring_player.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <vector>

#include "base/error.h"
#include "frames/ring/listen_socket.h"
#include "frames/ring/ring_memory.h"
#include "frames/ring/ring_protocol.h"
#include "frames/ring/slot_table.h"
#include "optics/trim.h"

namespace lenticule::frames {
namespace {

// Limits of one service() call, so that a flood of connections or messages cannot delay it.
constexpr size_t kMaxHandshakes = 4;
constexpr int kMaxAccepts = 8;
constexpr int kMaxMessages = 32;
/// A renderer needs one slot to write while another is displayed.
constexpr int kMinUsableSlots = 2;

UniqueFd open_pidfd(pid_t pid) {
  return UniqueFd(static_cast<int>(::syscall(SYS_pidfd_open, pid, 0)));
}

bool is_dead(const UniqueFd& pidfd) {
  pollfd query = {.fd = pidfd.get(), .events = POLLIN, .revents = 0};
  return ::poll(&query, 1, 0) > 0;
}

/// Returns the process that connected, as recorded by the kernel.
std::optional<ucred> credentials(const UniqueFd& socket) {
  ucred peer = {};
  socklen_t size = sizeof peer;
  if (::getsockopt(socket.get(), SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) return std::nullopt;
  return peer;
}

/// Connection is the connection to the renderer.
struct Connection {
  UniqueFd socket;
  UniqueFd published;  ///< eventfd; only armed edge-triggered and never read, because the peer can
                       ///< make reads of a shared description block
  UniqueFd process;    ///< pidfd
};

/// Departed is a renderer that has disconnected but may still be writing.
struct Departed {
  Epoch epoch;
  UniqueFd process;
};

/// Standing is the state of a connection after a message.
enum class Standing { Connected, SaidGoodbye, Lost };

struct Refusal {
  RefuseReason reason;
  std::string text;
};

RingLayout checked_layout(const RingOptions& options) {
  if (const char* problem = geometry_problem(options.geometry, options.slots))
    throw Error(ErrorKind::Usage, std::string("ring: ") + problem);
  if (options.geometry.format != PixelFormat::Rgb8)
    throw Error(ErrorKind::Usage, "ring: only 8-bit RGB frames can be played so far");
  return plan_layout(options.geometry, options.slots);
}

class Player final : public RingPlayer {
 public:
  explicit Player(const RingOptions& options)
      : options_(options),
        memory_(checked_layout(options), options.prefault),
        slot_table_(memory_.table(), options.keep_for_loop ? LoopKeeping::On : LoopKeeping::Off),
        listener_(options.socket),
        events_(::epoll_create1(EPOLL_CLOEXEC)) {
    memory_.header().epoch.store(slot_table_.epoch(), std::memory_order_relaxed);
    if (!events_ || !watch(listener_.fd(), EPOLLIN))
      throw Error(ErrorKind::Failed,
                  std::string("ring: cannot wait for renderers: ") + std::strerror(errno));
    handshakes_.reserve(kMaxHandshakes + 1);
    departed_.reserve(static_cast<size_t>(options.slots));
  }

  [[nodiscard]] FrameGeometry geometry() const override { return memory_.layout().geometry; }
  [[nodiscard]] std::optional<Rate> rate() const override { return hello_.rate; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return hello_.frame_count; }
  [[nodiscard]] PullStatus pull(AcquiredFrame& out) override;
  void release(uint64_t token) override;
  [[nodiscard]] int max_acquired() const override { return slot_table_.max_acquired(); }
  [[nodiscard]] uint64_t ready_count() const override { return slot_table_.ready_count(); }
  [[nodiscard]] bool saturated() const override { return slot_table_.saturated(); }
  [[nodiscard]] bool rewind() override { return slot_table_.rewind(); }
  [[nodiscard]] int wake_fd() const override { return events_.get(); }
  [[nodiscard]] bool waits_for_others() const override { return true; }
  void service() override;
  [[nodiscard]] std::string failure() const override { return {}; }
  [[nodiscard]] RingStatistics statistics() const override;

 private:
  [[nodiscard]] bool watch(int fd, uint32_t events) const noexcept;
  void clear_wake() const noexcept;
  void welcome();
  void answer_handshakes();
  [[nodiscard]] bool answer(UniqueFd& socket);
  void answer_hello(UniqueFd socket, const Packet& packet);
  [[nodiscard]] std::optional<Refusal> reason_to_refuse(const UniqueFd& socket,
                                                        const Packet& packet,
                                                        RendererHello& hello) const;
  [[nodiscard]] bool is_rig_welcome(const RendererHello& hello) const;
  void report_other_trim(const RendererHello& hello) const;
  [[nodiscard]] std::optional<Refusal> let_in(UniqueFd& socket, RendererHello hello);
  void serve_connection();
  [[nodiscard]] Standing obey(const Packet& packet);
  void send_away_if_misbehaved();
  void end_connection(Standing why);
  void recover_departed();
  void send_freed() const noexcept;

  const RingOptions options_;
  const optics::RigIdentity rig_ = optics::parse_identity(options_.rig_fingerprint);
  RingMemory memory_;
  SlotTable slot_table_;
  ListenSocket listener_;
  UniqueFd events_;
  std::vector<UniqueFd> handshakes_;  ///< connections that have sent no message yet; oldest first
  std::optional<Connection> connection_;
  std::vector<Departed> departed_;
  RendererHello hello_{.name = {}, .rig_fingerprint = {}, .rate = {}, .frame_count = {}};
  uint64_t renderers_ = 0;
  uint64_t refused_ = 0;
  uint64_t deaths_ = 0;
};

bool Player::watch(int fd, uint32_t events) const noexcept {
  epoll_event event = {};
  event.events = events;
  event.data.fd = fd;
  return ::epoll_ctl(events_.get(), EPOLL_CTL_ADD, fd, &event) == 0;
}

// --- frames ------------------------------------------------------------------------------------

PullStatus Player::pull(AcquiredFrame& out) {
  SlotTable::Frame frame;
  const PullStatus status = slot_table_.pull(frame);
  send_away_if_misbehaved();
  if (status == PullStatus::Ready)
    out = {.frame = memory_.frame(frame.slot),
           .number = frame.number,
           .token = static_cast<uint64_t>(frame.slot)};
  return status;
}

void Player::release(uint64_t token) {
  LENTICULE_CHECK(token < static_cast<uint64_t>(options_.slots));
  if (slot_table_.release(static_cast<int>(token))) send_freed();
  send_away_if_misbehaved();
}

/// Reports a free slot over the socket and not over an eventfd, which the renderer could make us
/// block on. If the queue is full of wake-ups, the renderer wakes anyway.
void Player::send_freed() const noexcept {
  if (connection_) (void)send_message(connection_->socket.get(), make_wake(MessageKind::Freed));
}

// --- housekeeping ------------------------------------------------------------------------------

/// Examines everything in every call: a handful of system calls that never wait, and no state that
/// could miss an event. The renderer comes first, so that new connections see its end.
void Player::service() {
  clear_wake();
  recover_departed();
  serve_connection();
  welcome();
  answer_handshakes();
  slot_table_.take_published();
  send_away_if_misbehaved();
}

void Player::clear_wake() const noexcept {
  std::array<epoll_event, 16> events;
  (void)::epoll_wait(events_.get(), events.data(), static_cast<int>(events.size()), 0);
}

void Player::recover_departed() {
  std::erase_if(departed_, [this](const Departed& renderer) {
    if (!is_dead(renderer.process)) return false;
    slot_table_.recover(renderer.epoch);
    send_freed();
    return true;
  });
}

void Player::welcome() {
  for (int i = 0; i < kMaxAccepts; ++i) {
    UniqueFd socket = listener_.accept();
    if (!socket) return;
    if (!watch(socket.get(), EPOLLIN)) continue;
    handshakes_.push_back(std::move(socket));
    // A connection that sends no message is dropped in favour of newer ones.
    if (handshakes_.size() > kMaxHandshakes) handshakes_.erase(handshakes_.begin());
  }
}

void Player::answer_handshakes() {
  std::erase_if(handshakes_, [this](UniqueFd& socket) { return answer(socket); });
}

/// Returns true when the handshake is complete, accepted or refused.
bool Player::answer(UniqueFd& socket) {
  Packet packet;
  switch (receive_packet(socket.get(), packet, PassedFds::Ignore)) {
    case Transfer::WouldBlock:
      return false;
    case Transfer::Closed:
      return true;
    case Transfer::Done:
      answer_hello(std::move(socket), packet);
      return true;
  }
  return true;
}

void Player::answer_hello(UniqueFd socket, const Packet& packet) {
  RendererHello hello;
  std::optional<Refusal> refusal = reason_to_refuse(socket, packet, hello);
  if (!refusal) refusal = let_in(socket, std::move(hello));
  if (!refusal) return;
  ++refused_;
  (void)send_message(socket.get(), make_refuse(refusal->reason, refusal->text));
}

bool Player::is_rig_welcome(const RendererHello& hello) const {
  if (rig_.fingerprint.empty()) return true;
  if (hello.rig_fingerprint.empty()) return false;
  return optics::match(optics::parse_identity(hello.rig_fingerprint), rig_) !=
         optics::RigMatch::Other;
}

void Player::report_other_trim(const RendererHello& hello) const {
  const optics::RigIdentity theirs = optics::parse_identity(hello.rig_fingerprint);
  if (options_.on_other_trim && optics::match(theirs, rig_) == optics::RigMatch::Trimmed)
    options_.on_other_trim(
        fmt::format("renderer '{}': {}", hello.name, optics::trim_difference(theirs, rig_)));
}

std::optional<Refusal> Player::reason_to_refuse(const UniqueFd& socket, const Packet& packet,
                                                RendererHello& hello) const {
  const auto peer = credentials(socket);
  if (!peer || (peer->uid != ::geteuid() && peer->uid != 0))
    return Refusal{RefuseReason::Forbidden, "the player belongs to another user"};
  MessagePrefix prefix;
  if (packet.size >= sizeof prefix) {
    std::memcpy(&prefix, packet.buffer.data(), sizeof prefix);
    if (prefix.magic == kMessageMagic && prefix.version != kProtocolVersion)
      return Refusal{RefuseReason::OtherVersion,
                     "the player speaks version " + std::to_string(kProtocolVersion) +
                         " of the ring's protocol, the renderer version " +
                         std::to_string(prefix.version)};
  }
  if (const char* problem = read_hello(packet.bytes(), hello))
    return Refusal{RefuseReason::BadHello, std::string("bad hello: ") + problem};
  if (!is_rig_welcome(hello))
    return Refusal{
        RefuseReason::OtherRig,
        "the player's rig is " + rig_.fingerprint + ", the renderer's is " +
            (hello.rig_fingerprint.empty() ? std::string("not stated") : hello.rig_fingerprint)};
  if (connection_) return Refusal{RefuseReason::Busy, "busy: '" + hello_.name + "' is connected"};
  if (options_.slots - slot_table_.shut() < kMinUsableSlots)
    return Refusal{RefuseReason::Busy, "busy: renderers that are disconnected but still run hold " +
                                           std::to_string(slot_table_.shut()) + " of " +
                                           std::to_string(options_.slots) + " slots"};
  return std::nullopt;
}

std::optional<Refusal> Player::let_in(UniqueFd& socket, RendererHello hello) {
  const auto peer = credentials(socket);
  // The previous renderer could still write there after it was disconnected; this must not affect
  // the next renderer.
  memory_.restore_header();
  slot_table_.renew_offers();
  Connection connection;
  if (peer) connection.process = open_pidfd(peer->pid);
  connection.published = UniqueFd(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
  if (!connection.process || !connection.published || !watch(connection.process.get(), EPOLLIN) ||
      !watch(connection.published.get(), EPOLLIN | EPOLLET))
    return Refusal{RefuseReason::Forbidden,
                   std::string("the player cannot watch the process: ") + std::strerror(errno)};
  const std::array<int, 2> fds = {memory_.fd(), connection.published.get()};
  const AcceptMessage accept = make_accept(memory_.layout().memory_bytes, slot_table_.epoch());
  if (send_message(socket.get(), accept, fds) != Transfer::Done)
    return Refusal{RefuseReason::Busy, "busy: the answer could not be sent"};
  connection.socket = std::move(socket);
  connection_ = std::move(connection);
  hello_ = std::move(hello);
  report_other_trim(hello_);
  ++renderers_;
  slot_table_.begin_connection(hello_.frame_count);
  return std::nullopt;
}

void Player::serve_connection() {
  if (!connection_) return;
  // Checked before the messages are read: all messages of a process that is dead now are in the
  // queue.
  const bool dead = is_dead(connection_->process);
  for (int i = 0; i < kMaxMessages; ++i) {
    Packet packet;
    const Transfer transfer = receive_packet(connection_->socket.get(), packet, PassedFds::Ignore);
    if (transfer == Transfer::WouldBlock && !dead) return;
    const Standing standing = transfer == Transfer::Done ? obey(packet) : Standing::Lost;
    if (standing != Standing::Connected) return end_connection(standing);
  }
}

Standing Player::obey(const Packet& packet) {
  MessagePrefix prefix;
  uint64_t published = 0;
  if (read_prefix(packet.bytes(), prefix) == nullptr && prefix.kind == MessageKind::Wanted) {
    slot_table_.slot_wanted();
    send_freed();  // a slot may have become free before the request arrived; the renderer looks
                   // again
    return slot_table_.misbehaved() ? Standing::Lost : Standing::Connected;
  }
  if (read_goodbye(packet.bytes(), published) != nullptr) return Standing::Lost;
  slot_table_.finish_sequence(published);
  return Standing::SaidGoodbye;
}

void Player::send_away_if_misbehaved() {
  if (slot_table_.misbehaved()) end_connection(Standing::Lost);
}

void Player::end_connection(Standing why) {
  if (why == Standing::Lost) ++deaths_;
  // The order matters: once the process is known to be dead, its last write to the table is final.
  const bool dead = is_dead(connection_->process);
  const Epoch epoch = slot_table_.epoch();
  const int shut = slot_table_.end_connection(dead ? RendererFate::Dead : RendererFate::MayLive);
  if (shut > 0) departed_.push_back({.epoch = epoch, .process = std::move(connection_->process)});
  connection_.reset();
  memory_.header().epoch.store(slot_table_.epoch(), std::memory_order_relaxed);
}

RingStatistics Player::statistics() const {
  return {.renderers = renderers_,
          .renderers_refused = refused_,
          .renderer_deaths = deaths_,
          .frames_accepted = slot_table_.accepted(),
          .slots_recovered = slot_table_.recovered(),
          .violations = slot_table_.violations(),
          .slots = options_.slots,
          .slots_shut = slot_table_.shut(),
          .renderer_connected = connection_.has_value(),
          .renderer_name = hello_.name,
          .heartbeat = memory_.header().heartbeat.load(std::memory_order_relaxed),
          .loop_obstacle = slot_table_.loop_obstacle()};
}

}  // namespace

std::unique_ptr<RingPlayer> RingPlayer::open(const RingOptions& options) {
  return std::make_unique<Player>(options);
}

}  // namespace lenticule::frames
