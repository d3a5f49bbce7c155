// SPDX-License-Identifier: Apache-2.0
// Provides a source whose frames become ready when a test decides, and a recorder that remembers
// the displayed frames.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "display/clock.h"
#include "display/scanout_recorder.h"
#include "frames/frame_source.h"

namespace lenticule::test {

/// Returns the pixels of frame `number`: every subpixel differs between numbers.
[[nodiscard]] frames::WovenFrame numbered_frame(frames::FrameGeometry geometry, uint64_t number);
/// Returns XXH64 of a frame's RGB bytes.
[[nodiscard]] uint64_t checksum_of(const frames::FrameView& frame);

/// A source without an end, of which every frame is ready. A test overrides what it is about.
class PlainSource : public frames::FrameSource {
 public:
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return std::nullopt; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return std::nullopt; }
  void release(uint64_t /*token*/) override {}
  [[nodiscard]] int max_acquired() const override { return 1; }
  [[nodiscard]] uint64_t ready_count() const override { return 1; }
  [[nodiscard]] bool saturated() const override { return true; }
  [[nodiscard]] bool rewind() override { return false; }
  [[nodiscard]] int wake_fd() const override { return -1; }
  void service() override {}
  [[nodiscard]] std::string failure() const override { return "the fake source broke"; }
};

struct FakeSourceScript {
  frames::FrameGeometry geometry{.width = 16, .height = 8};
  uint64_t frames = 10;
  std::optional<frames::Rate> rate = std::nullopt;
  bool can_rewind = true;
  /// Returns the time in `clock` at which pull number n (over all loops) is ready; at once if null.
  std::function<display::Nanoseconds(uint64_t)> ready_at = nullptr;
  std::shared_ptr<display::Clock> clock = nullptr;
  /// Number of pulled frames after which the source fails.
  std::optional<uint64_t> fails_after = std::nullopt;
};

class FakeSource final : public PlainSource {
 public:
  explicit FakeSource(FakeSourceScript script);

  [[nodiscard]] frames::FrameGeometry geometry() const override { return script_.geometry; }
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return script_.rate; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return script_.frames; }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override;
  void release(uint64_t token) override;
  [[nodiscard]] int max_acquired() const override { return 2; }
  [[nodiscard]] uint64_t ready_count() const override { return next_is_ready() ? 1 : 0; }
  [[nodiscard]] bool rewind() override;

  [[nodiscard]] uint64_t acquired() const { return acquired_; }

 private:
  [[nodiscard]] bool next_is_ready() const;

  FakeSourceScript script_;
  std::vector<frames::WovenFrame> pixels_;
  uint64_t position_ = 0;
  uint64_t pulled_ = 0;
  uint64_t acquired_ = 0;
};

struct DisplayedFrame {
  uint64_t sequence = 0;
  uint64_t id = 0;
  uint64_t checksum = 0;
  friend bool operator==(const DisplayedFrame&, const DisplayedFrame&) = default;
};

/// Remembers displayed frames. Thread safety: any thread may call.
class RememberingRecorder final : public display::ScanoutRecorder {
 public:
  void record(const display::ShownFrame& shown,
              const display::ScanoutView& scanout) noexcept override;
  void finish() override {}
  [[nodiscard]] std::vector<DisplayedFrame> shown() const;

 private:
  mutable std::mutex mutex_;
  std::vector<DisplayedFrame> shown_;
};

}  // namespace lenticule::test
