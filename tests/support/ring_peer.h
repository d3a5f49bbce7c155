// SPDX-License-Identifier: Apache-2.0
// What ring tests share: frames that show tearing, a folder for sockets, a serviced player.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "frames/ring/ring_player.h"
#include "frames/ring/ring_renderer.h"

namespace lenticule::test {

/// Writes `id` into every eight bytes (the tail gets its first bytes), so that any two frames
/// differ in every 4 KiB page.
void stamp_frame(std::span<uint8_t> pixels, uint64_t id);
/// The id, or nothing if not the whole frame carries the same.
[[nodiscard]] std::optional<uint64_t> stamped_id(std::span<const uint8_t> pixels);

/// A fresh folder with a short name; gone at the end.
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

/// 160 x 120 RGB: 57600 bytes, 15 pages.
[[nodiscard]] frames::RingOptions small_ring(const std::filesystem::path& socket);

/// Services the player, waiting on its wake_fd, until `done` or patience (20 s) is over: then
/// false.
[[nodiscard]] bool service_until(frames::RingPlayer& player, const std::function<bool()>& done);

/// Connects from another thread while this one services the player. Errors come out as thrown.
[[nodiscard]] std::unique_ptr<frames::RingRenderer> connect_to(
    frames::RingPlayer& player, const std::filesystem::path& socket,
    const frames::RendererHello& hello = {},
    std::chrono::milliseconds timeout = std::chrono::seconds(10));

/// Writes and publishes one stamped frame; the status of the step that went wrong, or Ok.
[[nodiscard]] frames::RingStatus push_frame(
    frames::RingRenderer& renderer, uint64_t number, uint64_t id,
    std::chrono::milliseconds timeout = std::chrono::milliseconds(0));

}  // namespace lenticule::test
