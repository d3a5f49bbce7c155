// SPDX-License-Identifier: Apache-2.0
// The player's end of the ring: it owns the shared memory, listens on a Unix socket, takes one
// renderer after another, and never believes what is in the shared memory.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "frames/frame_source.h"

namespace lenticule::frames {

struct RingOptions {
  std::filesystem::path socket;  ///< created with mode 0600; a dead one of ours is replaced
  FrameGeometry geometry;
  int slots = 8;  ///< 3 ... 4096; refused when they would take more than half of the free memory
  /// Fingerprint of the rig that frames must be rendered for (see optics/rig.h).
  std::string rig_fingerprint;
  /// Keep every frame of a sequence that fits the ring, so that rewind() works without a renderer.
  bool keep_for_loop = false;
};

struct RingStatistics {
  uint64_t renderers = 0;       ///< connections accepted so far
  uint64_t renderer_deaths = 0; ///< that ended without saying goodbye
  uint64_t frames_accepted = 0;
  uint64_t slots_recovered = 0; ///< half-written slots taken back from dead renderers
  uint64_t violations = 0;      ///< shared-memory states that no honest renderer makes
  int slots = 0;
  bool renderer_connected = false;
};

/// A FrameSource over a ring. One thread, except where FrameSource says otherwise.
class RingPlayer : public FrameSource {
 public:
  /// Throws Error(Failed) or Error(Device) when memory or socket cannot be had.
  [[nodiscard]] static std::unique_ptr<RingPlayer> open(const RingOptions& options);

  [[nodiscard]] virtual RingStatistics statistics() const = 0;
};

}  // namespace lenticule::frames
