// SPDX-License-Identifier: Apache-2.0
#include "tests/support/fakes/ring_peer.h"

#include <poll.h>
#include <stdlib.h>
#include <sys/socket.h>

#include <cstring>
#include <future>
#include <stdexcept>

#include "base/unix_address.h"
#include "frames/ring/listen_socket.h"
#include "frames/ring/ring_protocol.h"

namespace lenticule::test {
namespace {

constexpr auto kTimeout = std::chrono::seconds(20);
constexpr int kNapMilliseconds = 5;
constexpr int kAnswerMilliseconds = 20000;

}  // namespace

void stamp_frame(std::span<uint8_t> pixels, uint64_t id) {
  size_t at = 0;
  for (; at + sizeof id <= pixels.size(); at += sizeof id)
    std::memcpy(pixels.data() + at, &id, sizeof id);
  if (at < pixels.size()) std::memcpy(pixels.data() + at, &id, pixels.size() - at);
}

std::optional<uint64_t> stamped_id(std::span<const uint8_t> pixels) {
  uint64_t id = 0;
  if (pixels.size() < sizeof id) return std::nullopt;
  std::memcpy(&id, pixels.data(), sizeof id);
  // Shifted by eight bytes, the frame equals itself exactly if all of it carries the id.
  const size_t rest = pixels.size() - sizeof id;
  if (std::memcmp(pixels.data(), pixels.data() + sizeof id, rest) != 0) return std::nullopt;
  return id;
}

SocketFolder::SocketFolder() {
  char name[] = "/tmp/lenticule-ring-XXXXXX";
  if (!::mkdtemp(name)) throw std::runtime_error("no temporary folder");
  folder_ = name;
}

SocketFolder::~SocketFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

frames::RingOptions small_ring(const std::filesystem::path& socket) {
  frames::RingOptions options;
  options.socket = socket;
  options.geometry = {.width = 160, .height = 120, .format = frames::PixelFormat::Rgb8};
  options.slots = 4;
  return options;
}

bool service_until(frames::RingPlayer& player, const std::function<bool()>& done) {
  const auto deadline = std::chrono::steady_clock::now() + kTimeout;
  for (;;) {
    player.service();
    if (done()) return true;
    if (std::chrono::steady_clock::now() > deadline) return false;
    pollfd query = {.fd = player.wake_fd(), .events = POLLIN, .revents = 0};
    (void)::poll(&query, 1, kNapMilliseconds);
  }
}

void serviced(frames::RingPlayer& player, const std::function<void()>& body) {
  auto done = std::async(std::launch::async, body);
  const bool in_time = service_until(
      player, [&] { return done.wait_for(std::chrono::seconds(0)) == std::future_status::ready; });
  if (!in_time) throw std::runtime_error("not done in time");
  done.get();
}

std::unique_ptr<frames::RingRenderer> connect_to(frames::RingPlayer& player,
                                                 const std::filesystem::path& socket,
                                                 const frames::RendererHello& hello,
                                                 std::chrono::milliseconds timeout) {
  std::unique_ptr<frames::RingRenderer> renderer;
  serviced(player, [&] { renderer = frames::RingRenderer::connect(socket, hello, timeout); });
  return renderer;
}

std::vector<std::optional<uint64_t>> pull_all(frames::RingPlayer& player) {
  std::vector<std::optional<uint64_t>> ids;
  player.service();
  frames::AcquiredFrame frame;
  while (player.pull(frame) == frames::PullStatus::Ready) {
    ids.push_back(stamped_id(frame.frame.bytes));
    player.release(frame.token);
  }
  return ids;
}

UniqueFd knock(const std::filesystem::path& socket) {
  const UnixAddress address = unix_address(socket);
  UniqueFd fd(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
  if (!fd || ::connect(fd.get(), address.get(), address.bytes) != 0)
    throw std::runtime_error("cannot connect to " + socket.string());
  return fd;
}

RawRenderer::RawRenderer(const std::filesystem::path& socket) : socket_(knock(socket)) {
  using namespace frames;
  if (send_message(socket_.get(), make_hello({})) != Transfer::Done)
    throw std::runtime_error("hello was not sent");
  pollfd query = {.fd = socket_.get(), .events = POLLIN, .revents = 0};
  Packet packet;
  AcceptMessage accept;
  if (::poll(&query, 1, kAnswerMilliseconds) != 1 ||
      receive_packet(socket_.get(), packet, PassedFds::Take) != Transfer::Done)
    throw std::runtime_error("no answer");
  if (const char* problem = read_accept(packet.bytes(), accept)) throw std::runtime_error(problem);
  epoch_ = accept.epoch;
  memory_fd_ = std::move(packet.fds[0]);
  published_event_ = std::move(packet.fds[1]);
  memory_ = Mapping(memory_fd_.get(), 0, accept.memory_bytes, PROT_READ | PROT_WRITE);
  if (!memory_) throw std::runtime_error("cannot map");
  const auto* header = reinterpret_cast<const RingHeader*>(memory_.bytes().data());
  if (const char* problem = read_header(*header, accept.memory_bytes, layout_))
    throw std::runtime_error(problem);
}

std::span<frames::SlotEntry> RawRenderer::table() const {
  auto* first = reinterpret_cast<frames::SlotEntry*>(memory_.bytes().data() + layout_.table_offset);
  return {first, static_cast<size_t>(layout_.slots)};
}

std::span<uint8_t> RawRenderer::pixels(int slot) const {
  return memory_.bytes().subspan(layout_.slot_offset(slot), layout_.geometry.frame_bytes());
}

frames::RingStatus push_frame(frames::RingRenderer& renderer, uint64_t number, uint64_t id,
                              std::chrono::milliseconds timeout) {
  std::span<uint8_t> pixels;
  const auto status = renderer.acquire(number, timeout, pixels);
  if (status != frames::RingStatus::Ok) return status;
  stamp_frame(pixels, id);
  return renderer.publish();
}

}  // namespace lenticule::test
