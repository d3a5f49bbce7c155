// SPDX-License-Identifier: Apache-2.0
#include "frames/ring/ring_player.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <new>

#include "base/error.h"

namespace lenticule::frames {
namespace {

/// Returns the bytes available without swapping, from /proc/meminfo; 0 if unknown.
size_t available_memory() {
  std::ifstream meminfo("/proc/meminfo");
  std::string key;
  size_t kibibytes = 0;
  std::string unit;
  while (meminfo >> key >> kibibytes) {
    if (key == "MemAvailable:") return kibibytes * 1024;
    std::getline(meminfo, unit);
  }
  return 0;
}

constexpr size_t kMebibyte = size_t{1} << 20;

std::string mebibytes(size_t bytes) {
  return std::to_string((bytes + kMebibyte - 1) / kMebibyte) + " MiB";
}

[[noreturn]] void fail(const char* what) {
  throw Error(ErrorKind::Failed, std::string("ring: ") + what + ": " + std::strerror(errno));
}

void refuse_too_much(const RingLayout& layout) {
  const size_t available = available_memory();
  if (available == 0 || layout.memory_bytes <= available / 2) return;
  throw Error(ErrorKind::Failed,
              "ring: " + std::to_string(layout.slots) + " slots take " +
                  mebibytes(layout.memory_bytes) + ", more than half of the free " +
                  mebibytes(available),
              "use at most " + std::to_string(available / 2 / layout.slot_stride) + " slots");
}

UniqueFd create_memory(size_t bytes) {
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
void take_pages(int fd, const Mapping& pixels, size_t bytes) {
  if (::fallocate(fd, 0, 0, static_cast<off_t>(bytes)) != 0) fail("cannot get shared memory");
#ifdef MADV_POPULATE_READ
  ::madvise(pixels.bytes().data(), pixels.bytes().size(), MADV_POPULATE_READ);  // else: lazily
#endif
}

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

RingLayout checked_layout(const RingOptions& options) {
  if (const char* problem = geometry_problem(options.geometry, options.slots))
    throw Error(ErrorKind::Usage, std::string("ring: ") + problem);
  if (options.geometry.format != PixelFormat::Rgb8)
    throw Error(ErrorKind::Usage, "ring: only 8-bit RGB frames can be played so far");
  return plan_layout(options.geometry, options.slots);
}

}  // namespace

RingMemory::RingMemory(const RingLayout& layout, RingPrefault prefault) : layout_(layout) {
  refuse_too_much(layout);
  fd_ = create_memory(layout.memory_bytes);
  control_ = Mapping(fd_.get(), 0, layout.slots_offset, PROT_READ | PROT_WRITE);
  if (!control_) fail("cannot map the slot table");
  pixels_ =
      Mapping(fd_.get(), layout.slots_offset, layout.memory_bytes - layout.slots_offset, PROT_READ);
  if (!pixels_) fail("cannot map the slots");
  ::madvise(pixels_.bytes().data(), pixels_.bytes().size(),
            MADV_HUGEPAGE);  // ignored if not allowed
  if (prefault == RingPrefault::AtStart) take_pages(fd_.get(), pixels_, layout.memory_bytes);
  write_header(layout, *new (control_.bytes().data()) RingHeader());
  for (int slot = 0; slot < layout.slots; ++slot) new (&table()[slot]) SlotEntry();
}

RingHeader& RingMemory::header() const {
  return *std::launder(reinterpret_cast<RingHeader*>(control_.bytes().data()));
}

std::span<SlotEntry> RingMemory::table() const {
  auto* first = reinterpret_cast<SlotEntry*>(control_.bytes().data() + layout_.table_offset);
  return {first, static_cast<size_t>(layout_.slots)};
}

FrameView RingMemory::frame(int slot) const {
  const size_t offset = static_cast<size_t>(slot) * layout_.slot_stride;
  return {layout_.geometry, pixels_.bytes().subspan(offset, layout_.geometry.frame_bytes())};
}

RingPlayer::RingPlayer(const RingOptions& options)
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

bool RingPlayer::watch(int fd, uint32_t events) const noexcept {
  epoll_event event = {};
  event.events = events;
  event.data.fd = fd;
  return ::epoll_ctl(events_.get(), EPOLL_CTL_ADD, fd, &event) == 0;
}

// --- frames ------------------------------------------------------------------------------------

PullStatus RingPlayer::pull(AcquiredFrame& out) {
  SlotTable::Frame frame;
  const PullStatus status = slot_table_.pull(frame);
  drop_if_malformed();
  if (status == PullStatus::Ready)
    out = {.frame = memory_.frame(frame.slot),
           .number = frame.number,
           .token = static_cast<uint64_t>(frame.slot)};
  return status;
}

void RingPlayer::release(uint64_t token) {
  LENTICULE_CHECK(token < static_cast<uint64_t>(options_.slots));
  if (slot_table_.release(static_cast<int>(token))) send_freed();
  drop_if_malformed();
}

/// Reports a free slot over the socket and not over an eventfd, which the renderer could make us
/// block on. If the queue is full of wake-ups, the renderer wakes anyway.
void RingPlayer::send_freed() const noexcept {
  if (connection_) (void)send_message(connection_->socket.get(), make_wake(MessageKind::Freed));
}

// --- housekeeping ------------------------------------------------------------------------------

/// Examines everything in every call: a handful of system calls that never wait, and no state that
/// could miss an event. The renderer comes first, so that new connections see its end.
void RingPlayer::service() {
  clear_wake();
  recover_departed();
  serve_connection();
  accept();
  answer_handshakes();
  slot_table_.take_published();
  drop_if_malformed();
}

void RingPlayer::clear_wake() const noexcept {
  std::array<epoll_event, 16> events;
  (void)::epoll_wait(events_.get(), events.data(), static_cast<int>(events.size()), 0);
}

void RingPlayer::recover_departed() {
  std::erase_if(departed_, [this](const Departed& renderer) {
    if (!is_dead(renderer.process)) return false;
    slot_table_.recover(renderer.epoch);
    send_freed();
    return true;
  });
}

void RingPlayer::accept() {
  for (int i = 0; i < kMaxAccepts; ++i) {
    UniqueFd socket = listener_.accept();
    if (!socket) return;
    if (!watch(socket.get(), EPOLLIN)) continue;
    handshakes_.push_back(std::move(socket));
    // A connection that sends no message is dropped in favour of newer ones.
    if (handshakes_.size() > kMaxHandshakes) handshakes_.erase(handshakes_.begin());
  }
}

void RingPlayer::answer_handshakes() {
  std::erase_if(handshakes_, [this](UniqueFd& socket) { return answer(socket); });
}

/// Returns true when the handshake is complete, accepted or refused.
bool RingPlayer::answer(UniqueFd& socket) {
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

void RingPlayer::answer_hello(UniqueFd socket, const Packet& packet) {
  RendererHello hello;
  std::optional<Refusal> refusal = reason_to_refuse(socket, packet, hello);
  if (!refusal) refusal = admit(socket, std::move(hello));
  if (!refusal) return;
  ++refused_;
  (void)send_message(socket.get(), make_refuse(refusal->reason, refusal->text));
}

bool RingPlayer::is_rig_accepted(const RendererHello& hello) const {
  if (rig_.fingerprint.empty()) return true;
  if (hello.rig_fingerprint.empty()) return false;
  return optics::match(optics::parse_identity(hello.rig_fingerprint), rig_) !=
         optics::RigMatch::Other;
}

void RingPlayer::report_other_trim(const RendererHello& hello) const {
  const optics::RigIdentity theirs = optics::parse_identity(hello.rig_fingerprint);
  if (options_.on_other_trim && optics::match(theirs, rig_) == optics::RigMatch::Trimmed)
    options_.on_other_trim(
        fmt::format("renderer '{}': {}", hello.name, optics::trim_difference(theirs, rig_)));
}

std::optional<RingPlayer::Refusal> RingPlayer::reason_to_refuse(const UniqueFd& socket,
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
  if (!is_rig_accepted(hello))
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

std::optional<RingPlayer::Refusal> RingPlayer::admit(UniqueFd& socket, RendererHello hello) {
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

void RingPlayer::serve_connection() {
  if (!connection_) return;
  // Checked before the messages are read: all messages of a process that is dead now are in the
  // queue.
  const bool dead = is_dead(connection_->process);
  for (int i = 0; i < kMaxMessages; ++i) {
    Packet packet;
    const Transfer transfer = receive_packet(connection_->socket.get(), packet, PassedFds::Ignore);
    if (transfer == Transfer::WouldBlock && !dead) return;
    const ConnectionState state =
        transfer == Transfer::Done ? handle(packet) : ConnectionState::Lost;
    if (state != ConnectionState::Connected) return end_connection(state);
  }
}

RingPlayer::ConnectionState RingPlayer::handle(const Packet& packet) {
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

void RingPlayer::drop_if_malformed() {
  if (slot_table_.misbehaved()) end_connection(ConnectionState::Lost);
}

void RingPlayer::end_connection(ConnectionState why) {
  if (why == ConnectionState::Lost) ++deaths_;
  // The order matters: once the process is known to be dead, its last write to the table is final.
  const bool dead = is_dead(connection_->process);
  const Epoch epoch = slot_table_.epoch();
  const int shut = slot_table_.end_connection(dead ? RendererFate::Dead : RendererFate::MayLive);
  if (shut > 0) departed_.push_back({.epoch = epoch, .process = std::move(connection_->process)});
  connection_.reset();
  memory_.header().epoch.store(slot_table_.epoch(), std::memory_order_relaxed);
}

RingStatistics RingPlayer::statistics() const {
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

std::unique_ptr<RingPlayer> RingPlayer::open(const RingOptions& options) {
  return std::unique_ptr<RingPlayer>(new RingPlayer(options));
}

}  // namespace lenticule::frames
