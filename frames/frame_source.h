// SPDX-License-Identifier: Apache-2.0
// Where a player gets woven frames from: a ring, a folder of pictures, later a container. Pulled by
// one thread, never blocking.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "frames/frame.h"
#include "frames/rational.h"

namespace lenticule::frames {

enum class PullStatus {
  Ready,   ///< a frame was handed over
  NotYet,  ///< nothing ready now; wait on wake_fd()
  End,     ///< the sequence is over (and will stay so until rewind())
  Failed,  ///< the source is broken for good; see failure()
};

/// A frame lent by a source. `bytes` stay unchanged until release(token).
struct LentFrame {
  FrameView frame;
  uint64_t number = 0;  ///< position in the sequence, 0-based
  uint64_t token = 0;
  uint32_t item = 0;  ///< of a source that plays one thing after the other: which of them
};

/// Frames of a source that did not come as they were made.
struct FrameDamage {
  uint64_t damaged = 0;   ///< could not be read, or only with errors
  uint64_t missing = 0;   ///< are not in the file, which says that they are
  uint64_t repeated = 0;  ///< another frame was shown in place of a damaged one

  [[nodiscard]] bool any() const { return damaged + missing + repeated > 0; }
  FrameDamage& operator+=(const FrameDamage& other) {
    damaged += other.damaged;
    missing += other.missing;
    repeated += other.repeated;
    return *this;
  }
  friend bool operator==(const FrameDamage&, const FrameDamage&) = default;
};

class FrameSource {
 public:
  virtual ~FrameSource() = default;

  [[nodiscard]] virtual FrameGeometry geometry() const = 0;
  /// Content rate of the frame pulled last, or of the first, if the source states one.
  [[nodiscard]] virtual std::optional<Rate> rate() const = 0;
  /// Number of frames if known.
  [[nodiscard]] virtual std::optional<uint64_t> frame_count() const = 0;

  /// The next frame in order. At most `max_lent()` may be lent at a time.
  [[nodiscard]] virtual PullStatus pull(LentFrame& out) = 0;
  virtual void release(uint64_t token) = 0;
  [[nodiscard]] virtual int max_lent() const = 0;

  /// Frames that pull() would hand over at once (an estimate for statistics and priming).
  [[nodiscard]] virtual uint64_t ready_count() const = 0;
  /// True when nothing more becomes ready until frames are released or the sequence restarts:
  /// everything is prefetched, or the sequence is complete. Ends priming early.
  [[nodiscard]] virtual bool saturated() const = 0;

  /// Starts over at frame 0 for a gapless loop, to be called after End. False if the source cannot.
  [[nodiscard]] virtual bool rewind() = 0;

  /// Becomes readable when pull() may have more; -1 if the source is always ready.
  [[nodiscard]] virtual int wake_fd() const = 0;
  /// Clears wake_fd() and does the source's housekeeping (peers, connections). Cheap, non-blocking.
  virtual void service() = 0;

  [[nodiscard]] virtual std::string failure() const = 0;

  /// So far. Safe from any thread.
  [[nodiscard]] virtual FrameDamage damage() const { return {}; }
  /// A pixel's width over its height, as the file says. Woven frames have square ones.
  [[nodiscard]] virtual double pixel_aspect() const { return 1.0; }

  /// Nothing is ready, and nothing is late either: what is on the glass may stay there.
  [[nodiscard]] virtual bool nothing_owed() const { return false; }
  /// Grows, in pull() or service(), when somebody wants to see something else at once: frames that
  /// were pulled before that need not be shown any more.
  [[nodiscard]] virtual uint64_t cut() const { return 0; }
};

}  // namespace lenticule::frames
