// SPDX-License-Identifier: Apache-2.0
// Provides for ring tests: frames that reveal tearing, a folder for sockets, a serviced player.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/unique_fd.h"
#include "frames/ring/ring_layout.h"
#include "frames/ring/ring_player.h"
#include "frames/ring/ring_renderer.h"

namespace lenticule::frames {

/// RingStatistics are the counts of a player.
struct RingStatistics {
  explicit RingStatistics(const RingPlayer& player)
      : renderers(player.renderers_),
        renderers_refused(player.refused_),
        renderer_deaths(player.deaths_),
        frames_accepted(player.slot_table_.accepted()),
        slots_recovered(player.slot_table_.recovered()),
        violations(player.slot_table_.violations()),
        slots_shut(player.slot_table_.shut()),
        renderer_connected(player.renderer_connected()),
        renderer_name(player.hello_.name),
        heartbeat(player.memory_.header().heartbeat.load(std::memory_order_relaxed)) {}

  uint64_t renderers;          ///< connections accepted so far
  uint64_t renderers_refused;  ///< renderers that sent Hello and were refused
  uint64_t renderer_deaths;    ///< renderers that disconnected without a Goodbye message
  uint64_t frames_accepted;
  uint64_t slots_recovered;  ///< half-written slots recovered from dead renderers
  uint64_t violations;       ///< shared-memory states that a correct renderer never makes
  int slots_shut;            ///< slots still mapped by a disconnected renderer that may be writing
  bool renderer_connected;
  std::string renderer_name;  ///< name of the present or the last renderer
  uint32_t heartbeat;         ///< changes while the connected renderer works or waits for a slot
};

}  // namespace lenticule::frames

namespace lenticule::test {

[[nodiscard]] inline frames::RingStatistics statistics_of(const frames::RingPlayer& player) {
  return frames::RingStatistics(player);
}

/// Writes `id` into every eight bytes (the tail gets its first bytes), so that any two frames
/// differ in every 4 KiB page.
void stamp_frame(std::span<uint8_t> pixels, uint64_t id);
/// Returns the id; nothing if not the whole frame carries the same id.
[[nodiscard]] std::optional<uint64_t> stamped_id(std::span<const uint8_t> pixels);

/// Creates a folder with a short name and removes it at the end.
class SocketFolder {
 public:
  SocketFolder();
  ~SocketFolder();
  SocketFolder(const SocketFolder&) = delete;
  SocketFolder& operator=(const SocketFolder&) = delete;
  [[nodiscard]] std::filesystem::path socket() const { return folder_ / "ring"; }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

 private:
  std::filesystem::path folder_;
};

/// Returns options for 160 x 120 RGB: 57600 bytes, 15 pages.
[[nodiscard]] frames::RingOptions small_ring(const std::filesystem::path& socket);

/// Services the player, waiting on its wake_fd, until `done`; returns false after 20 s.
[[nodiscard]] bool service_until(frames::RingPlayer& player, const std::function<bool()>& done);

/// Runs `body` in another thread while this one services the player; rethrows its exception.
void serviced(frames::RingPlayer& player, const std::function<void()>& body);

/// Connects from another thread while this one services the player; rethrows errors.
[[nodiscard]] std::unique_ptr<frames::RingRenderer> connect_to(
    frames::RingPlayer& player, const std::filesystem::path& socket,
    const frames::RendererHello& hello = {},
    std::chrono::milliseconds timeout = std::chrono::seconds(10));

/// Writes and publishes one stamped frame; returns the status of the step that failed, or Ok.
[[nodiscard]] frames::RingStatus push_frame(
    frames::RingRenderer& renderer, uint64_t number, uint64_t id,
    std::chrono::milliseconds timeout = std::chrono::milliseconds(0));

/// Pulls and releases every frame that is ready; returns the ids in order, nothing for a torn
/// frame.
[[nodiscard]] std::vector<std::optional<uint64_t>> pull_all(frames::RingPlayer& player);

/// Returns a connected SEQPACKET socket before any message.
[[nodiscard]] UniqueFd knock(const std::filesystem::path& socket);

/// A renderer that need not follow the protocol: after a valid handshake the test may write
/// anything to the shared memory and the socket. Waits at most 20 s for the player.
class RawRenderer {
 public:
  explicit RawRenderer(const std::filesystem::path& socket);

  [[nodiscard]] int socket() const { return socket_.get(); }
  [[nodiscard]] int memory_fd() const { return memory_fd_.get(); }
  [[nodiscard]] int published_event() const { return published_event_.get(); }
  [[nodiscard]] frames::Epoch epoch() const { return epoch_; }
  [[nodiscard]] std::span<uint8_t> memory() const { return memory_.bytes(); }
  [[nodiscard]] std::span<frames::SlotEntry> table() const;
  [[nodiscard]] std::span<uint8_t> pixels(int slot) const;
  /// Closes the socket and keeps the memory mapped.
  void hang_up() { socket_.reset(); }

 private:
  UniqueFd socket_;
  UniqueFd memory_fd_;
  UniqueFd published_event_;
  frames::Epoch epoch_ = 0;
  frames::RingLayout layout_;
  frames::Mapping memory_;
};

}  // namespace lenticule::test
