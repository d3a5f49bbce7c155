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

#include "base/unique_fd.h"
#include "frames/frame.h"
#include "frames/rational.h"
#include "frames/ring/ring_layout.h"

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

struct RingAdmission;

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
  ~RingRenderer();
  RingRenderer(const RingRenderer&) = delete;
  RingRenderer& operator=(const RingRenderer&) = delete;

  /// Returns the geometry that the player requires.
  [[nodiscard]] FrameGeometry geometry() const { return layout_.geometry; }
  [[nodiscard]] int slots() const { return layout_.slots; }

  /// Acquires a free slot for frame `number`; its bytes are undefined. At most one slot at a time.
  [[nodiscard]] RingStatus acquire(uint64_t number, std::chrono::milliseconds timeout,
                                   std::span<uint8_t>& pixels);
  /// Publishes the acquired slot. Frames are shown in the order of publishing.
  [[nodiscard]] RingStatus publish();
  /// Releases the acquired slot without publishing it.
  void abandon();

  /// Completes the sequence, then sends the Goodbye message.
  void finish();

 private:
  RingRenderer(const std::string& path, RingAdmission admission);
  [[nodiscard]] bool take_slot() noexcept;
  void read_messages() noexcept;
  void beat() noexcept;
  void ask_for_slot() noexcept;

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
