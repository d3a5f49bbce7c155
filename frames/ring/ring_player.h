// SPDX-License-Identifier: Apache-2.0
// RingPlayer is the player's end of the ring: it owns the shared memory, listens on a Unix socket,
// accepts one renderer after another, and never trusts the content of the shared memory.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <functional>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error_kinds.h"
#include "base/large_memory.h"
#include "base/unique_fd.h"
#include "frames/frame_source.h"
#include "frames/ring/listen_socket.h"
#include "frames/ring/ring_layout.h"
#include "frames/ring/ring_protocol.h"
#include "frames/ring/slot_table.h"
#include "optics/trim.h"

namespace lenticule::frames {

struct RingOptions {
  std::filesystem::path socket;  ///< created with mode 0600; our own stale socket is replaced
  FrameGeometry geometry;        ///< only Rgb8 is supported
  int slots = 8;  ///< 3 ... 4096; refused when they would need more than half of the free memory
  /// The rig that frames must be rendered for, as a text of optics::to_text(RigIdentity): a
  /// fingerprint, and the calibration that the rig is a trim of; empty = any rig. Frames for
  /// another trim of the same calibration are accepted too.
  std::string rig_fingerprint;
  /// Asks for this in each picture; Woven refuses renderers of views, all others refuse renderers
  /// of woven frames.
  RingContent content = {};
  /// Called with one sentence when a renderer with another trim is accepted, on the thread of
  /// pull().
  std::function<void(const std::string&)> on_other_trim = nullptr;
  /// Keep every frame of a sequence that fits the ring, so that rewind() works without a renderer.
  /// A sequence fits if it has at most `slots` frames. While the sequence may fit, shown frames
  /// stay in their slots. When the renderer requests one more slot than the ring has, slots are
  /// recycled from then on and rewind() returns false (loop_obstacle() has the reason).
  bool keep_for_loop = false;
};

/// RingMemory is the player's mapping of a ring: a sealed memfd, its header and table writable, its
/// slots read-only.
class RingMemory {
 public:
  /// Throws Error(Usage) for a geometry that no ring can have, Error(Failed) when the ring would
  /// need more than half of the free memory or the kernel refuses.
  explicit RingMemory(const RingLayout& layout) : layout_(layout) {
    refuse_too_much(layout);
    fd_ = create_memory(layout.memory_bytes);
    control_ = Mapping(fd_.get(), 0, layout.slots_offset, PROT_READ | PROT_WRITE);
    if (!control_) fail("cannot map the slot table");
    pixels_ = Mapping(fd_.get(), layout.slots_offset, layout.memory_bytes - layout.slots_offset,
                      PROT_READ);
    if (!pixels_) fail("cannot map the slots");
    ::madvise(pixels_.bytes().data(), pixels_.bytes().size(),
              MADV_HUGEPAGE);  // ignored if not allowed
    take_pages(fd_.get(), pixels_, layout.memory_bytes);
    write_header(layout, *new (control_.bytes().data()) RingHeader());
    for (int slot = 0; slot < layout.slots; ++slot) new (&table()[slot]) SlotEntry();
  }

  [[nodiscard]] const RingLayout& layout() const { return layout_; }
  [[nodiscard]] int fd() const { return fd_.get(); }
  [[nodiscard]] RingHeader& header() const {
    return *std::launder(reinterpret_cast<RingHeader*>(control_.bytes().data()));
  }
  [[nodiscard]] std::span<SlotEntry> table() const {
    auto* first = reinterpret_cast<SlotEntry*>(control_.bytes().data() + layout_.table_offset);
    return {first, static_cast<size_t>(layout_.slots)};
  }
  /// Rewrites the constant fields.
  void restore_header() const { write_header(layout_, header()); }
  /// Returns the whole frame in a slot, with its present bytes.
  [[nodiscard]] FrameView frame(int slot) const {
    const size_t offset = static_cast<size_t>(slot) * layout_.slot_stride;
    return {layout_.geometry, pixels_.bytes().subspan(offset, layout_.geometry.frame_bytes())};
  }

 private:
  static constexpr size_t kMebibyte = size_t{1} << 20;

  static std::string mebibytes(size_t bytes) {
    return std::to_string((bytes + kMebibyte - 1) / kMebibyte) + " MiB";
  }

  [[noreturn]] static void fail(const char* what) {
    throw failed_error("ring: {}: {}", what, std::strerror(errno));
  }

  static void refuse_too_much(const RingLayout& layout) {
    const size_t available = available_memory();
    if (available == 0 || layout.memory_bytes <= available / 2) return;
    throw failed_error("ring: {} slots take {}, more than half of the free {}", layout.slots,
                       mebibytes(layout.memory_bytes), mebibytes(available))
        .remedy("use at most " + std::to_string(available / 2 / layout.slot_stride) + " slots");
  }

  static UniqueFd create_memory(size_t bytes) {
    UniqueFd fd(::memfd_create("lenticule-ring", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    if (!fd) fail("cannot create shared memory");
    if (::ftruncate(fd.get(), static_cast<off_t>(bytes)) != 0) fail("cannot size shared memory");
    // The seals keep a renderer from shrinking the memory while it is mapped here: the next read
    // would raise SIGBUS.
    if (::fcntl(fd.get(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0)
      fail("cannot seal shared memory");
    return fd;
  }

  /// Allocates the pages now, so that a machine with too little memory fails here and not during
  /// playback, and the first cycle through the ring has no page faults.
  static void take_pages(int fd, const Mapping& pixels, size_t bytes) {
    if (::fallocate(fd, 0, 0, static_cast<off_t>(bytes)) != 0) fail("cannot get shared memory");
#ifdef MADV_POPULATE_READ
    ::madvise(pixels.bytes().data(), pixels.bytes().size(), MADV_POPULATE_READ);  // else: lazily
#endif
  }
  RingLayout layout_;
  UniqueFd fd_;
  Mapping control_;  ///< header and table
  Mapping pixels_;   ///< slots, read-only: the player cannot damage a frame
};

/// RingPlayer is a FrameSource over a ring.
///
/// Renderers connect and disconnect, one at a time; pull() reports sequences, not renderers:
/// - A renderer that dies without a Goodbye message leaves its sequence open: pull() returns the
///   published frames, then NotYet, and the next renderer continues the same sequence.
/// - A Goodbye message completes the sequence: once its frames are pulled, pull() returns End until
///   rewind() succeeds or the next renderer connects. The next renderer begins a new sequence, so
///   the caller should keep pulling after End (also after rewind() returned false). If the next
///   renderer connects before End was returned, End is returned once between the sequences.
/// - rewind() works with keep_for_loop, after End, for a sequence that fits, until a new sequence
///   begins. It also works while frames are acquired: such a frame may then be acquired once more.
/// - rate() and frame_count() are the values that the present or the last renderer stated.
/// pull() never returns Failed. release() and pull() make progress visible to the renderer at once;
/// service() handles connections and deaths.
///
/// Thread safety: one thread, except where FrameSource states otherwise.
class RingPlayer final : public FrameSource {
 public:
  /// Throws Error(Usage) for invalid options, Error(Failed) when memory or socket are unavailable,
  /// Error(Device) when another player listens on the socket.
  [[nodiscard]] static std::unique_ptr<RingPlayer> open(const RingOptions& options) {
    return std::unique_ptr<RingPlayer>(new RingPlayer(options));
  }

  [[nodiscard]] FrameGeometry geometry() const override { return memory_.layout().geometry; }
  [[nodiscard]] std::optional<Rate> rate() const override { return hello_.rate; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return hello_.frame_count; }
  [[nodiscard]] PullStatus pull(AcquiredFrame& out) override {
    SlotTable::Frame frame;
    const PullStatus status = slot_table_.pull(frame);
    drop_if_malformed();
    if (status == PullStatus::Ready)
      out = {.frame = memory_.frame(frame.slot),
             .number = frame.number,
             .token = static_cast<uint64_t>(frame.slot)};
    return status;
  }
  void release(uint64_t token) override {
    LENTICULE_CHECK(token < static_cast<uint64_t>(options_.slots));
    if (slot_table_.release(static_cast<int>(token))) send_freed();
    drop_if_malformed();
  }
  /// Returns the number of the last frame of the present or the last renderer.
  [[nodiscard]] std::optional<uint64_t> last_number() const { return slot_table_.last_number(); }
  [[nodiscard]] int max_acquired() const override { return slot_table_.max_acquired(); }
  [[nodiscard]] uint64_t ready_count() const override { return slot_table_.ready_count(); }
  [[nodiscard]] bool saturated() const override { return slot_table_.saturated(); }
  [[nodiscard]] bool rewind() override { return slot_table_.rewind(); }
  [[nodiscard]] int wake_fd() const override { return events_.get(); }
  [[nodiscard]] bool waits_for_others() const override { return true; }
  /// Examines everything in every call: a handful of system calls that never wait, and no state
  /// that could miss an event. The renderer comes first, so that new connections see its end.
  void service() override {
    clear_wake();
    recover_departed();
    serve_connection();
    accept();
    answer_handshakes();
    slot_table_.take_published();
    drop_if_malformed();
  }
  [[nodiscard]] std::string failure() const override { return {}; }
  [[nodiscard]] bool renderer_connected() const { return connection_.has_value(); }
  /// Returns the reason why rewind() cannot work; empty if it may.
  [[nodiscard]] std::string loop_obstacle() const { return slot_table_.loop_obstacle(); }

 private:
  friend struct RingStatistics;  // with which tests look at the counts
  // Limits of one service() call, so that a flood of connections or messages cannot delay it.
  static constexpr size_t kMaxHandshakes = 4;
  static constexpr int kMaxAccepts = 8;
  static constexpr int kMaxMessages = 32;
  /// A renderer needs one slot to write while another is displayed.
  static constexpr int kMinUsableSlots = 2;

  static UniqueFd open_pidfd(pid_t pid) {
    return UniqueFd(static_cast<int>(::syscall(SYS_pidfd_open, pid, 0)));
  }

  static bool is_dead(const UniqueFd& pidfd) {
    pollfd query = {.fd = pidfd.get(), .events = POLLIN, .revents = 0};
    return ::poll(&query, 1, 0) > 0;
  }

  /// Returns the process that connected, as recorded by the kernel.
  static std::optional<ucred> credentials(const UniqueFd& socket) {
    ucred peer = {};
    socklen_t size = sizeof peer;
    if (::getsockopt(socket.get(), SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) return std::nullopt;
    return peer;
  }

  static RingLayout checked_layout(const RingOptions& options) {
    if (const char* problem = geometry_problem(options.geometry, options.slots))
      throw usage_error("ring: {}", problem);
    if (options.geometry.format != PixelFormat::Rgb8)
      throw Error(ErrorKind::Usage, "ring: only 8-bit RGB frames can be played so far");
    RingLayout layout = plan_layout(options.geometry, options.slots);
    layout.content = options.content;
    return layout;
  }
  /// Connection is the connection to the renderer.
  struct Connection {
    UniqueFd socket;
    UniqueFd published;  ///< eventfd; only armed edge-triggered and never read, because the peer
                         ///< can make reads of a shared description block
    UniqueFd process;    ///< pidfd
  };

  /// Departed is a renderer that has disconnected but may still be writing.
  struct Departed {
    Epoch epoch;
    UniqueFd process;
  };

  /// ConnectionState is the state of a connection after a message.
  enum class ConnectionState { Connected, SaidGoodbye, Lost };

  struct Refusal {
    RefuseReason reason;
    std::string text;
  };

  explicit RingPlayer(const RingOptions& options)
      : options_(options),
        memory_(checked_layout(options)),
        slot_table_(memory_.table(), options.keep_for_loop ? LoopKeeping::On : LoopKeeping::Off),
        listener_(options.socket),
        events_(::epoll_create1(EPOLL_CLOEXEC)) {
    memory_.header().epoch.store(slot_table_.epoch(), std::memory_order_relaxed);
    if (!events_ || !watch(listener_.fd(), EPOLLIN))
      throw failed_error("ring: cannot wait for renderers: {}", std::strerror(errno));
    handshakes_.reserve(kMaxHandshakes + 1);
    departed_.reserve(static_cast<size_t>(options.slots));
  }
  [[nodiscard]] bool watch(int fd, uint32_t events) const noexcept {
    epoll_event event = {};
    event.events = events;
    event.data.fd = fd;
    return ::epoll_ctl(events_.get(), EPOLL_CTL_ADD, fd, &event) == 0;
  }
  void clear_wake() const noexcept {
    std::array<epoll_event, 16> events;
    (void)::epoll_wait(events_.get(), events.data(), static_cast<int>(events.size()), 0);
  }
  void accept() {
    for (int i = 0; i < kMaxAccepts; ++i) {
      UniqueFd socket = listener_.accept();
      if (!socket) return;
      if (!watch(socket.get(), EPOLLIN)) continue;
      handshakes_.push_back(std::move(socket));
      // A connection that sends no message is dropped in favour of newer ones.
      if (handshakes_.size() > kMaxHandshakes) handshakes_.erase(handshakes_.begin());
    }
  }
  void answer_handshakes() {
    std::erase_if(handshakes_, [this](UniqueFd& socket) { return answer(socket); });
  }
  /// Returns true when the handshake is complete, accepted or refused.
  [[nodiscard]] bool answer(UniqueFd& socket) {
    Packet packet;
    const Transfer transfer = receive_packet(socket.get(), packet, PassedFds::Ignore);
    if (transfer == Transfer::Done) answer_hello(std::move(socket), packet);
    return transfer != Transfer::WouldBlock;
  }
  void answer_hello(UniqueFd socket, const Packet& packet) {
    RendererHello hello;
    std::optional<Refusal> refusal = reason_to_refuse(socket, packet, hello);
    if (!refusal) refusal = admit(socket, std::move(hello));
    if (!refusal) return;
    ++refused_;
    (void)send_message(socket.get(), make_refuse(refusal->reason, refusal->text));
  }
  [[nodiscard]] std::optional<Refusal> reason_to_refuse(const UniqueFd& socket,
                                                        const Packet& packet,
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
    if (hello.views != (options_.content.kind != RingContent::Woven))
      return Refusal{RefuseReason::BadHello,
                     fmt::format("the player takes {} of {}x{} pixels, the renderer pushes {}",
                                 hello.views ? "woven frames" : "views", options_.geometry.width,
                                 options_.geometry.height, hello.views ? "views" : "woven frames")};
    if (!is_rig_accepted(hello))
      return Refusal{
          RefuseReason::OtherRig,
          "the player's rig is " + rig_.fingerprint + ", the renderer's is " +
              (hello.rig_fingerprint.empty() ? std::string("not stated") : hello.rig_fingerprint)};
    if (connection_) return Refusal{RefuseReason::Busy, "busy: '" + hello_.name + "' is connected"};
    if (options_.slots - slot_table_.shut() < kMinUsableSlots)
      return Refusal{RefuseReason::Busy,
                     "busy: renderers that are disconnected but still run hold " +
                         std::to_string(slot_table_.shut()) + " of " +
                         std::to_string(options_.slots) + " slots"};
    return std::nullopt;
  }
  [[nodiscard]] bool is_rig_accepted(const RendererHello& hello) const {
    if (rig_.fingerprint.empty()) return true;
    if (hello.rig_fingerprint.empty()) return false;
    return optics::match(optics::parse_identity(hello.rig_fingerprint), rig_) !=
           optics::RigMatch::Other;
  }
  void report_other_trim(const RendererHello& hello) const {
    const optics::RigIdentity theirs = optics::parse_identity(hello.rig_fingerprint);
    if (options_.on_other_trim && optics::match(theirs, rig_) == optics::RigMatch::Trimmed)
      options_.on_other_trim(
          fmt::format("renderer '{}': {}", hello.name, optics::trim_difference(theirs, rig_)));
  }
  [[nodiscard]] std::optional<Refusal> admit(UniqueFd& socket, RendererHello hello) {
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
  void serve_connection() {
    if (!connection_) return;
    // Checked before the messages are read: all messages of a process that is dead now are in the
    // queue.
    const bool dead = is_dead(connection_->process);
    for (int i = 0; i < kMaxMessages; ++i) {
      Packet packet;
      const Transfer transfer =
          receive_packet(connection_->socket.get(), packet, PassedFds::Ignore);
      if (transfer == Transfer::WouldBlock && !dead) return;
      const ConnectionState state =
          transfer == Transfer::Done ? handle(packet) : ConnectionState::Lost;
      if (state != ConnectionState::Connected) return end_connection(state);
    }
  }
  [[nodiscard]] ConnectionState handle(const Packet& packet) {
    MessagePrefix prefix;
    uint64_t published = 0;
    if (read_prefix(packet.bytes(), prefix) == nullptr && prefix.kind == MessageKind::Wanted) {
      slot_table_.slot_wanted();
      send_freed();  // a slot may have become free before the request arrived; the renderer looks
                     // again
      return slot_table_.misbehaved() ? ConnectionState::Lost : ConnectionState::Connected;
    }
    if (read_goodbye(packet.bytes(), published) != nullptr) return ConnectionState::Lost;
    slot_table_.finish_sequence(published);
    return ConnectionState::SaidGoodbye;
  }
  void drop_if_malformed() {
    if (slot_table_.misbehaved()) end_connection(ConnectionState::Lost);
  }
  void end_connection(ConnectionState why) {
    if (why == ConnectionState::Lost) ++deaths_;
    // The order matters: once the process is known to be dead, its last write to the table is
    // final.
    const bool dead = is_dead(connection_->process);
    const Epoch epoch = slot_table_.epoch();
    const int shut = slot_table_.end_connection(dead ? RendererFate::Dead : RendererFate::MayLive);
    if (shut > 0) departed_.push_back({.epoch = epoch, .process = std::move(connection_->process)});
    connection_.reset();
    memory_.header().epoch.store(slot_table_.epoch(), std::memory_order_relaxed);
  }
  void recover_departed() {
    std::erase_if(departed_, [this](const Departed& renderer) {
      if (!is_dead(renderer.process)) return false;
      slot_table_.recover(renderer.epoch);
      send_freed();
      return true;
    });
  }
  /// Reports a free slot over the socket and not over an eventfd, which the renderer could make us
  /// block on. If the queue is full of wake-ups, the renderer wakes anyway.
  void send_freed() const noexcept {
    if (connection_) (void)send_message(connection_->socket.get(), make_wake(MessageKind::Freed));
  }

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

}  // namespace lenticule::frames
