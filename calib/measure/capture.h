// SPDX-License-Identifier: Apache-2.0
// PatternCapture shows patterns on a panel and takes pictures that are verified to show these
// patterns.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>

#include "calib/camera.h"
#include "calib/measure/frame_marks.h"
#include "calib/measure/pattern.h"
#include "frames/frame_source.h"

namespace lenticule::calib {

struct CaptureOptions {
  /// Time from the flip until the panel and the camera's pipeline no longer contain the previous
  /// picture.
  Nanoseconds settle{std::chrono::milliseconds(150)};
  int average = 3;  ///< pictures per pattern, 1 to 64
  Nanoseconds show_timeout{std::chrono::seconds(5)};
  Nanoseconds grab_timeout{std::chrono::seconds(2)};
  int most_dropped =
      40;  ///< limit of pictures per pattern that are late, damaged or of another pattern
  /// False if pictures arrive in the order of the patterns whenever they are requested:
  /// photographs.
  bool clocked = true;
  /// Name of the place and number of all patterns, for messages about photographs.
  std::string place{};
  int patterns = 0;
};

struct CaptureCounts {
  int taken = 0;
  int late = 0;       ///< pictures of the previous pattern, by time or by mark
  int unsettled = 0;  ///< pictures between two patterns although the settle time had passed
  int corrupt = 0;
};

/// CaptureProgress is called before each pattern; returning false ends the capture with
/// Error(Failed) "interrupted".
using CaptureProgress = std::function<bool(const Pattern& pattern)>;

/// PatternCapture draws the next pattern on a second thread meanwhile.
///
/// Thread safety: one thread.
///
/// Lifetime: sink, camera and panel must outlive the capture.
class PatternCapture {
 public:
  PatternCapture(frames::FrameSink& sink, Camera& camera, const optics::Panel& panel,
                 const CaptureOptions& options, CaptureProgress progress);

  /// Shows each pattern and passes the mean of its pictures to `take`, in order. Each pattern is
  /// marked with a number; once the marks are found they are checked, and the light is corrected
  /// for the camera's gain. Throws Error(Device): display lost, camera gone or without pictures,
  /// pictures of other patterns than were shown, a camera control that changed.
  void capture(std::span<const Pattern> patterns,
               const std::function<void(const Pattern&, const CameraPicture&)>& take);

  /// Makes the patterns show the code of their rig. Call it before the first pattern.
  void show_code(const RigCode& code) { code_ = code; }
  /// Starts the check of the marks in pictures.
  void check_marks(MarkReader reader);
  /// Returns the codes of the pictures taken so far, one for each pattern.
  [[nodiscard]] const RigCodeReadings& codes() const { return codes_; }
  /// Returns MarkReader::moved of each pattern's first picture; zero until marks are checked.
  [[nodiscard]] const std::vector<Vec2>& moves() const { return moves_; }

  /// Returns the sequence numbers of photographs that show the same pattern as the one before
  /// them and were not used.
  [[nodiscard]] const std::vector<uint64_t>& doubles() const { return doubles_; }
  [[nodiscard]] const CaptureCounts& counts() const { return counts_; }

 private:
  void capture_one(const Pattern& pattern, const frames::WovenFrame& frame);
  void show(const frames::WovenFrame& frame);
  void grab(Nanoseconds not_before);
  enum class Fit { Good, Late, Unsettled, Lost, Double };
  [[nodiscard]] Fit fit_of(const Pattern& pattern, Nanoseconds earliest, double& gain);
  void remember_marks();
  void add(double gain);
  [[nodiscard]] bool shows_pattern(size_t number) const;
  [[nodiscard]] bool camera_moved() const;
  [[noreturn]] void fail_missing(size_t first, size_t count) const;
  void fail_dropped(const Pattern& pattern, Fit last) const;
  void fail_photograph(Fit last) const;

  frames::FrameSink& sink_;
  Camera& camera_;
  const optics::Panel& panel_;
  CaptureOptions options_;
  CaptureProgress progress_;
  std::optional<RigCode> code_;
  std::optional<MarkReader> marks_;
  MarkReading reading_;
  RigCodeReadings codes_;
  std::vector<Vec2> moves_;
  std::vector<uint64_t> doubles_;
  double reference_white_ = 0.0;
  int next_mark_ = 0;
  CameraPicture picture_;
  CameraPicture sum_;
  int summed_ = 0;
  CaptureCounts counts_;
};

}  // namespace lenticule::calib
