// SPDX-License-Identifier: Apache-2.0
// The player's end of the ring: it owns the shared memory, listens on a Unix socket, takes one
// renderer after another, and never believes what is in the shared memory.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "frames/frame_source.h"

namespace lenticule::frames {

enum class RingPrefault {
  AtStart,  ///< take all memory in open(): later there is neither a page fault nor a shortage
  Lazily,   ///< take a slot's memory when it is first written
};

struct RingOptions {
  std::filesystem::path socket;  ///< created with mode 0600; a dead one of ours is replaced
  FrameGeometry geometry;        ///< Rgb8 so far
  int slots = 8;  ///< 3 ... 4096; refused when they would take more than half of the free memory
  /// The rig that frames must be rendered for, as optics::to_text(RigIdentity) says it: a
  /// fingerprint, and what it is a trim of; empty = any. Frames for another trim of the same
  /// calibration are taken, too.
  std::string rig_fingerprint;
  /// Told in one sentence when a renderer with another trim is let in. On the thread of pull().
  std::function<void(const std::string&)> on_other_trim = nullptr;
  /// Keep every frame of a sequence that fits the ring, so that rewind() works without a renderer.
  /// A sequence fits if it has at most `slots` frames. As long as that may be, shown frames stay in
  /// their slots; when the renderer asks for one slot more than there are, slots are recycled from
  /// then on and rewind() returns false (RingStatistics::loop_obstacle says why).
  bool keep_for_loop = false;
  RingPrefault prefault = RingPrefault::AtStart;
};

struct RingStatistics {
  uint64_t renderers = 0;          ///< connections accepted so far
  uint64_t renderers_refused = 0;  ///< that said hello and were sent away
  uint64_t renderer_deaths = 0;    ///< that ended without saying goodbye
  uint64_t frames_accepted = 0;
  uint64_t slots_recovered = 0;  ///< half-written slots taken back from dead renderers
  uint64_t violations = 0;       ///< shared-memory states that no honest renderer makes
  int slots = 0;
  int slots_shut = 0;  ///< still mapped by a disconnected renderer that may be writing
  bool renderer_connected = false;
  std::string renderer_name;  ///< of the present or the last one
  uint32_t heartbeat = 0;     ///< moves while the connected renderer works or waits for a slot
  std::string loop_obstacle;  ///< why rewind() cannot work for this sequence; empty if it may
};

/// A FrameSource over a ring. One thread, except where FrameSource says otherwise.
///
/// Renderers come and go, one at a time, and pull() tells sequences, not renderers:
/// - A renderer that dies without goodbye leaves its sequence open: what it had published is still
///   handed out, then NotYet, and the next renderer goes on with the same sequence.
/// - A goodbye completes the sequence: once its frames are pulled, pull() returns End, and again
/// End
///   until rewind() succeeds or the next renderer connects; that one begins a new sequence, so
///   after End (also after rewind() returned false) it makes sense to keep pulling. If the next
///   renderer connects before End was handed out, End is handed out once, between the sequences.
/// - rewind() works with keep_for_loop, after End, for a sequence that fits, as long as no new
///   sequence has begun. It works while frames are lent: such a frame may then be lent once more.
/// - rate() and frame_count() are what the present or the last renderer stated.
/// pull() never returns Failed. release() and pull() make progress visible to the renderer at once;
/// connections and deaths are dealt with in service().
class RingPlayer : public FrameSource {
 public:
  /// Throws Error(Usage) for options that no ring can have, Error(Failed) when memory or socket
  /// cannot be had, Error(Device) when another player listens on the socket.
  [[nodiscard]] static std::unique_ptr<RingPlayer> open(const RingOptions& options);

  [[nodiscard]] virtual RingStatistics statistics() const = 0;
};

}  // namespace lenticule::frames
