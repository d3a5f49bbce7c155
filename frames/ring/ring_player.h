// SPDX-License-Identifier: Apache-2.0
// RingPlayer is the player's end of the ring: it owns the shared memory, listens on a Unix socket,
// accepts one renderer after another, and never trusts the content of the shared memory.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "frames/frame_source.h"

namespace lenticule::frames {

enum class RingPrefault {
  AtStart,  ///< take all memory in open(), so that later there is neither a page fault nor a
            ///< shortage
  Lazily,   ///< take a slot's memory when it is first written
};

struct RingOptions {
  std::filesystem::path socket;  ///< created with mode 0600; our own stale socket is replaced
  FrameGeometry geometry;        ///< only Rgb8 is supported
  int slots = 8;  ///< 3 ... 4096; refused when they would need more than half of the free memory
  /// The rig that frames must be rendered for, as a text of optics::to_text(RigIdentity): a
  /// fingerprint, and the calibration that the rig is a trim of; empty = any rig. Frames for
  /// another trim of the same calibration are accepted too.
  std::string rig_fingerprint;
  /// Called with one sentence when a renderer with another trim is accepted, on the thread of
  /// pull().
  std::function<void(const std::string&)> on_other_trim = nullptr;
  /// Keep every frame of a sequence that fits the ring, so that rewind() works without a renderer.
  /// A sequence fits if it has at most `slots` frames. While the sequence may fit, shown frames
  /// stay in their slots. When the renderer requests one more slot than the ring has, slots are
  /// recycled from then on and rewind() returns false (RingStatistics::loop_obstacle has the
  /// reason).
  bool keep_for_loop = false;
  RingPrefault prefault = RingPrefault::AtStart;
};

struct RingStatistics {
  uint64_t renderers = 0;          ///< connections accepted so far
  uint64_t renderers_refused = 0;  ///< renderers that sent Hello and were refused
  uint64_t renderer_deaths = 0;    ///< renderers that disconnected without a Goodbye message
  uint64_t frames_accepted = 0;
  uint64_t slots_recovered = 0;  ///< half-written slots recovered from dead renderers
  uint64_t violations = 0;       ///< shared-memory states that a correct renderer never makes
  int slots = 0;
  int slots_shut = 0;  ///< slots still mapped by a disconnected renderer that may be writing
  bool renderer_connected = false;
  std::string renderer_name;  ///< name of the present or the last renderer
  uint32_t heartbeat = 0;     ///< changes while the connected renderer works or waits for a slot
  std::string loop_obstacle;  ///< reason why rewind() cannot work; empty if it may
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
class RingPlayer : public FrameSource {
 public:
  /// Throws Error(Usage) for invalid options, Error(Failed) when memory or socket are unavailable,
  /// Error(Device) when another player listens on the socket.
  [[nodiscard]] static std::unique_ptr<RingPlayer> open(const RingOptions& options);

  [[nodiscard]] virtual RingStatistics statistics() const = 0;
};

}  // namespace lenticule::frames
