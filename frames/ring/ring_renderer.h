// SPDX-License-Identifier: Apache-2.0
// RingRenderer is the renderer's end of the ring: it connects to a player and writes frames into
// its slots.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "frames/frame.h"
#include "frames/rational.h"

namespace lenticule::frames {

struct RendererHello {
  std::string name = "lenticule";  ///< name in the player's log
  std::string rig_fingerprint;     ///< empty = not stated, which a player with a rig refuses
  std::optional<Rate> rate;        ///< content rate
  std::optional<uint64_t> frame_count;
};

enum class RingStatus {
  Ok,
  TimedOut,  ///< no slot became free in time; call again
  Gone,      ///< the player has exited; connect again
};

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
                                                             std::chrono::milliseconds timeout);
  virtual ~RingRenderer() = default;

  /// Returns the geometry that the player requires.
  [[nodiscard]] virtual FrameGeometry geometry() const = 0;
  [[nodiscard]] virtual int slots() const = 0;

  /// Acquires a free slot for frame `number`; its bytes are undefined. At most one slot at a time.
  [[nodiscard]] virtual RingStatus acquire(uint64_t number, std::chrono::milliseconds timeout,
                                           std::span<uint8_t>& pixels) = 0;
  /// Publishes the acquired slot. Frames are shown in the order of publishing.
  [[nodiscard]] virtual RingStatus publish() = 0;
  /// Releases the acquired slot without publishing it.
  virtual void abandon() = 0;

  /// Completes the sequence, then sends the Goodbye message.
  virtual void finish() = 0;
};

}  // namespace lenticule::frames
