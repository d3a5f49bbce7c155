// SPDX-License-Identifier: Apache-2.0
// The renderer's end of the ring: connect to a player, write frames into its slots.
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
  std::string name = "lenticule";  ///< for the player's log
  std::string rig_fingerprint;     ///< empty = not checked by us, refused by a player that has one
  std::optional<Rate> rate;        ///< content rate
  std::optional<uint64_t> frame_count;
};

enum class RingStatus {
  Ok,
  TimedOut,  ///< no slot became free in time; ask again
  Gone,      ///< the player is gone; connect anew
};

/// One connection. One thread.
class RingRenderer {
 public:
  /// Waits at most `timeout` for a player to listen. Throws Error(Device) when none does, and
  /// Error(Input) when the player refuses us (another rig, another geometry), with its reason.
  [[nodiscard]] static std::unique_ptr<RingRenderer> connect(const std::filesystem::path& socket,
                                                             const RendererHello& hello,
                                                             std::chrono::milliseconds timeout);
  virtual ~RingRenderer() = default;

  /// What the player wants.
  [[nodiscard]] virtual FrameGeometry geometry() const = 0;
  [[nodiscard]] virtual int slots() const = 0;

  /// A free slot to write frame `number` into; its bytes hold garbage. At most one at a time.
  [[nodiscard]] virtual RingStatus acquire(uint64_t number, std::chrono::milliseconds timeout,
                                           std::span<uint8_t>& pixels) = 0;
  /// Hands the slot over. Frames are shown in the order of publishing.
  [[nodiscard]] virtual RingStatus publish() = 0;
  /// Gives the slot back unwritten.
  virtual void abandon() = 0;

  /// Says that the sequence is complete, then goodbye.
  virtual void finish() = 0;
};

}  // namespace lenticule::frames
