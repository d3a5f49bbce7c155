// SPDX-License-Identifier: Apache-2.0
#include "tests/support/ring_peer.h"

#include <poll.h>
#include <stdlib.h>

#include <cstring>
#include <future>
#include <stdexcept>

namespace lenticule::test {
namespace {

constexpr auto kPatience = std::chrono::seconds(20);
constexpr int kNapMilliseconds = 5;

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
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  for (;;) {
    player.service();
    if (done()) return true;
    if (std::chrono::steady_clock::now() > deadline) return false;
    pollfd query = {.fd = player.wake_fd(), .events = POLLIN, .revents = 0};
    (void)::poll(&query, 1, kNapMilliseconds);
  }
}

std::unique_ptr<frames::RingRenderer> connect_to(frames::RingPlayer& player,
                                                 const std::filesystem::path& socket,
                                                 const frames::RendererHello& hello,
                                                 std::chrono::milliseconds timeout) {
  auto connection = std::async(
      std::launch::async, [&] { return frames::RingRenderer::connect(socket, hello, timeout); });
  const bool answered = service_until(player, [&] {
    return connection.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  });
  if (!answered) throw std::runtime_error("connect() did not return in time");
  return connection.get();
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
