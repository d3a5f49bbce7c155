// SPDX-License-Identifier: Apache-2.0
// FrameSource provides woven frames to a player: from a ring, a folder of pictures or a container.
// FrameSink shows a program's own frames.
//
// Thread safety: one thread pulls; no call blocks.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "frames/frame.h"
#include "frames/rational.h"

namespace lenticule::frames {

enum class PullStatus {
  Ready,   ///< pull() returned a frame
  NotYet,  ///< no frame is ready now; wait on wake_fd()
  End,     ///< the sequence has ended (and stays so until rewind())
  Failed,  ///< the source has failed permanently; see failure()
};

/// AcquiredFrame is a frame acquired from a source. `bytes` stay unchanged until release(token).
struct AcquiredFrame {
  FrameView frame;
  uint64_t number = 0;  ///< position in the sequence, 0-based
  uint64_t token = 0;
  uint32_t item = 0;     ///< index of the item, in a source that plays several items in turn
  bool repeats = false;  ///< the picture is that of the frame before
  /// Time on CLOCK_MONOTONIC at which a camera took the picture; 0 if it did not come in live. Such
  /// a frame replaces all earlier ones.
  int64_t captured_ns = 0;
};

/// FrameDamage counts frames that were not played as they were made.
struct FrameDamage {
  uint64_t damaged = 0;   ///< frames that could not be read, or only with errors
  uint64_t missing = 0;   ///< frames that the file announces but does not contain
  uint64_t repeated = 0;  ///< damaged frames in whose place another frame was shown

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
  /// Returns the content rate of the last pulled frame, or of the first frame before any pull, if
  /// the source states a rate.
  [[nodiscard]] virtual std::optional<Rate> rate() const = 0;
  /// Returns the number of frames, if known.
  [[nodiscard]] virtual std::optional<uint64_t> frame_count() const = 0;

  /// Acquires the next frame in order. At most `max_acquired()` frames may be acquired at a time.
  /// A source delivers while fewer are, even if the caller keeps the oldest.
  [[nodiscard]] virtual PullStatus pull(AcquiredFrame& out) = 0;
  virtual void release(uint64_t token) = 0;
  [[nodiscard]] virtual int max_acquired() const = 0;

  /// Returns the number of frames that pull() would return at once (an estimate for statistics and
  /// priming).
  [[nodiscard]] virtual uint64_t ready_count() const = 0;
  /// Returns true when no more frames become ready until frames are released or the sequence
  /// restarts: everything is prefetched, or the sequence is complete. Ends priming early.
  [[nodiscard]] virtual bool saturated() const = 0;

  /// Restarts at frame 0 for a gapless loop; to be called after End. Returns false if the source
  /// cannot.
  [[nodiscard]] virtual bool rewind() = 0;

  /// Returns a descriptor that becomes readable when pull() may have more frames; -1 if the source
  /// is always ready.
  [[nodiscard]] virtual int wake_fd() const = 0;
  /// Clears wake_fd() and does the source's housekeeping (peers, connections). Cheap, non-blocking.
  virtual void service() = 0;

  [[nodiscard]] virtual std::string failure() const = 0;

  /// Returns the damage so far.
  ///
  /// Thread safety: any thread.
  [[nodiscard]] virtual FrameDamage damage() const { return {}; }
  /// Returns the hardware decoder that makes the frames, or "software: " and the reason why
  /// hardware that could do so is not used; empty if there is no such hardware.
  ///
  /// Thread safety: any thread.
  [[nodiscard]] virtual std::string video_decoder() const { return {}; }
  /// Returns a pixel's width divided by its height, as the file states. Woven frames have square
  /// pixels.
  [[nodiscard]] virtual double pixel_aspect() const { return 1.0; }

  /// Returns true if no frame is ready and none is due (paused, or between items): the displayed
  /// frame may stay, and this is not an underrun.
  [[nodiscard]] virtual bool nothing_due() const { return false; }
  /// Returns true if the next frame depends on more than this source: on a renderer in another
  /// process, or on an item that is still being opened.
  [[nodiscard]] virtual bool waits_for_others() const { return false; }
  /// Returns a generation number, which pull() or service() increments when playback jumps. Frames
  /// pulled under an older number need not be shown any more.
  ///
  /// Thread safety: any thread.
  [[nodiscard]] virtual uint64_t cut() const { return 0; }
};

// FrameSink is the smallest interface that shows woven frames. Calibration draws through it, so
// that simulated and real panels are interchangeable.

enum class ShowResult {
  Shown,     ///< the frame is on the panel
  TimedOut,  ///< deadline missed; the sink is still usable
  Lost,      ///< the display was disconnected
};

class FrameSink {
 public:
  virtual ~FrameSink() = default;

  /// Returns the exact size and format that show() requires.
  [[nodiscard]] virtual FrameGeometry geometry() const = 0;

  /// Copies the frame and waits until it is on the panel, at most `timeout`.
  ///
  /// Thread safety: one thread.
  [[nodiscard]] virtual ShowResult show(const FrameView& frame,
                                        std::chrono::nanoseconds timeout) = 0;
};

/// NullSink accepts frames of one size without showing them: photographs of them exist already.
class NullSink final : public FrameSink {
 public:
  NullSink(int width, int height) : geometry_{.width = width, .height = height} {}
  [[nodiscard]] FrameGeometry geometry() const override { return geometry_; }
  [[nodiscard]] ShowResult show(const FrameView&, std::chrono::nanoseconds) override {
    return ShowResult::Shown;
  }

 private:
  FrameGeometry geometry_;
};

}  // namespace lenticule::frames
