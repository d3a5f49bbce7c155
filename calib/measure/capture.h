// SPDX-License-Identifier: Apache-2.0
// PatternCapture shows patterns on a panel and takes pictures that are verified to show these
// patterns.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <future>
#include <optional>
#include <span>
#include <string>

#include "base/error_kinds.h"
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
                 const CaptureOptions& options, CaptureProgress progress)
      : sink_(sink),
        camera_(camera),
        panel_(panel),
        options_(options),
        progress_(std::move(progress)) {
    const frames::FrameGeometry wanted = sink.geometry();
    if (wanted.width != panel.width_px || wanted.height != panel.height_px)
      throw input_error("display: has {} x {} pixels, but the rig's panel has {} x {}",
                        wanted.width, wanted.height, panel.width_px, panel.height_px)
          .remedy("run the panel at its own resolution");
  }

  /// Shows each pattern and passes the mean of its pictures to `take`, in order. Each pattern is
  /// marked with a number; once the marks are found they are checked, and the light is corrected
  /// for the camera's gain. Throws Error(Device): display lost, camera gone or without pictures,
  /// pictures of other patterns than were shown, a camera control that changed.
  void capture(std::span<const Pattern> patterns,
               const std::function<void(const Pattern&, const CameraPicture&)>& take) {
    std::vector<Pattern> marked(patterns.begin(), patterns.end());
    size_t number = moves_.size();
    for (Pattern& pattern : marked) {
      if (pattern.mark == kNoMark) pattern.mark = next_mark_;
      next_mark_ = (pattern.mark + 1) % kMarkCounts;
      if (code_) pattern.code = code_->of_pattern(number++);
    }
    const auto draw = [&](size_t k) {
      frames::WovenFrame frame;
      draw_pattern(marked[k], panel_, frame);
      return frame;
    };
    std::future<frames::WovenFrame> next;
    for (size_t k = 0; k < marked.size(); ++k) {
      if (progress_ && !progress_(marked[k]))
        throw Error(ErrorKind::Failed, "calibrate: interrupted");
      const frames::WovenFrame frame = next.valid() ? next.get() : draw(k);
      if (k + 1 < marked.size()) next = std::async(std::launch::async, draw, k + 1);
      capture_one(marked[k], frame);
      take(marked[k], sum_);
    }
  }

  /// Makes the patterns show the code of their rig. Call it before the first pattern.
  void show_code(const RigCode& code) { code_ = code; }
  /// Starts the check of the marks in pictures.
  void check_marks(MarkReader reader) {
    marks_ = std::move(reader);
    reference_white_ = 0.0;
  }
  /// Returns the codes of the pictures taken so far, one for each pattern.
  [[nodiscard]] const RigCodeReadings& codes() const { return codes_; }
  /// Returns MarkReader::moved of each pattern's first picture; zero until marks are checked.
  [[nodiscard]] const std::vector<Vec2>& moves() const { return moves_; }

  /// Returns the sequence numbers of photographs that show the same pattern as the one before
  /// them and were not used.
  [[nodiscard]] const std::vector<uint64_t>& doubles() const { return doubles_; }
  [[nodiscard]] const CaptureCounts& counts() const { return counts_; }

 private:
  /// A camera that times out so many times in a row counts as dead.
  static constexpr int kMostSilences = 3;
  /// Limit of pictures of one pattern, independent of their times.
  static constexpr int kMostPictures = 1000;
  /// Additional wait after each picture that shows the panel between two patterns.
  static constexpr Nanoseconds kMoreSettling = std::chrono::milliseconds(20);
  void capture_one(const Pattern& pattern, const frames::WovenFrame& frame) {
    show(frame);
    Nanoseconds earliest = camera_.now() + options_.settle;
    summed_ = 0;
    Fit last = Fit::Good;
    for (int dropped = 0, seen = 0; summed_ < options_.average; ++seen) {
      if (seen > kMostPictures) fail_dropped(pattern, Fit::Late);
      grab(options_.clocked ? earliest : Nanoseconds::min());
      double gain = 1.0;
      last = fit_of(pattern, earliest, gain);
      if (last == Fit::Good) {
        if (summed_ == 0) remember_marks();
        add(gain);
        continue;
      }
      if (last == Fit::Double) {
        doubles_.push_back(picture_.sequence);
        continue;
      }
      ++(last == Fit::Unsettled ? counts_.unsettled : counts_.late);
      if (last == Fit::Unsettled) earliest = picture_.time + kMoreSettling;
      // Pictures from before `earliest` come from the camera's pipeline and are not counted as
      // dropped.
      const bool expected = options_.clocked && last == Fit::Late && picture_.time < earliest;
      if (!expected && ++dropped > options_.most_dropped) fail_dropped(pattern, last);
    }
    const auto count = static_cast<float>(summed_);
    for (float& light : sum_.light) light /= count;
    ++counts_.taken;
  }
  void show(const frames::WovenFrame& frame) {
    switch (sink_.show(frame.view(), options_.show_timeout)) {
      case frames::ShowResult::Shown:
        return;
      case frames::ShowResult::TimedOut:
        throw Error(ErrorKind::Device, "display: a pattern was not displayed in time",
                    "another program may use the display");
      case frames::ShowResult::Lost:
        throw Error(ErrorKind::Device, "display: disconnected while patterns were shown",
                    "connect it again and start over; the rig file is unchanged");
    }
  }
  void grab(Nanoseconds not_before) {
    const Nanoseconds timeout = options_.grab_timeout;
    int silences = 0;
    while (true) {
      switch (camera_.grab(picture_, timeout, not_before)) {
        case GrabStatus::Ready:
          return;
        case GrabStatus::Corrupt:
          if (++counts_.corrupt % 100 == 0)
            throw Error(ErrorKind::Device, "camera: a hundred damaged pictures",
                        "try another cable, a lower resolution or another pixel format");
          continue;
        case GrabStatus::TimedOut:
          if (++silences < kMostSilences) continue;
          throw device_error("camera: no picture for {} s",
                             kMostSilences * std::chrono::duration<double>(timeout).count())
              .remedy("check whether another program uses it");
        case GrabStatus::Gone:
          if (!options_.clocked)
            throw input_error("{}, and that of pattern {} of {} is missing", camera_.failure(),
                              moves_.size() + 1, options_.patterns)
                .remedy("photograph this place again, every pattern once and in their order");
          throw Error(ErrorKind::Device, "camera: " + camera_.failure(),
                      "nothing was written; connect the camera again and start over");
      }
    }
  }
  enum class Fit { Good, Late, Unsettled, Lost, Double };
  [[nodiscard]] Fit fit_of(const Pattern& pattern, Nanoseconds earliest, double& gain) {
    if (options_.clocked && picture_.time < earliest) return Fit::Late;
    if (!marks_) return Fit::Good;
    reading_ = marks_->read(grey_of(picture_));
    if (reading_.state == MarkState::Lost) return Fit::Lost;
    if (reading_.state == MarkState::Unsettled) return Fit::Unsettled;
    if (reading_.mark != pattern.mark)
      return !options_.clocked && shows_pattern(moves_.size() - 1) ? Fit::Double : Fit::Late;
    if (reference_white_ > 0.0) gain = reading_.white / reference_white_;
    return Fit::Good;
  }
  void remember_marks() {
    codes_.add(reading_.code);
    moves_.push_back(marks_ ? marks_->moved(grey_of(picture_)) : Vec2{});
  }
  void add(double gain) {
    if (marks_ && reference_white_ == 0.0) reference_white_ = marks_->read(grey_of(picture_)).white;
    const auto factor = static_cast<float>(1.0 / gain);
    if (summed_++ == 0) {
      sum_ = picture_;
      for (float& light : sum_.light) light *= factor;
      return;
    }
    if (sum_.light.size() != picture_.light.size())
      throw Error(ErrorKind::Device, "camera: the size of its pictures changed");
    for (size_t i = 0; i < sum_.light.size(); ++i) sum_.light[i] += factor * picture_.light[i];
  }
  /// Returns true if the marks and the code of the last picture are those of pattern `number`,
  /// counted from 0.
  [[nodiscard]] bool shows_pattern(size_t number) const {
    const bool code_fits =
        !code_ || reading_.code == kNoCode || reading_.code == code_->of_pattern(number);
    return code_fits && reading_.mark == static_cast<int>(number % kMarkCounts);
  }
  /// Returns true if the last picture shows the marks at another place than the first ones.
  [[nodiscard]] bool camera_moved() const {
    const Vec2 moved = marks_ ? marks_->moved(grey_of(picture_)) : Vec2{};
    return std::hypot(moved.x, moved.y) > kKnockPx;
  }
  [[noreturn]] void fail_missing(size_t first, size_t count) const {
    const std::string which =
        count == 1 ? fmt::format("the photograph of pattern {} of {} is missing", first + 1,
                                 options_.patterns)
                   : fmt::format("the photographs of patterns {} to {} of {} are missing",
                                 first + 1, first + count, options_.patterns);
    throw input_error("{}: {}", options_.place, which)
        .remedy("photograph this place again, every pattern once and in their order");
  }
  void fail_dropped(const Pattern& pattern, Fit last) const {
    if (!options_.clocked) return fail_photograph(last);
    if (last == Fit::Lost)
      throw Error(ErrorKind::Device, "camera: the marks in the panel's middle are no longer seen",
                  "check whether the camera moved, or something hides the panel");
    if (camera_moved())
      throw device_error("camera: it moved between pattern {} and {}", moves_.size(),
                         moves_.size() + 1)
          .remedy("put it on a stand, and measure this place again");
    if (last == Fit::Unsettled)
      throw Error(ErrorKind::Device, "camera: every picture shows the panel between two patterns",
                  "the exposure may be too long, or a program changes the panel's brightness");
    throw device_error("camera: never sees pattern number {}", pattern.mark)
        .remedy("pictures may come late (a larger --settle-ms), or out of order");
  }
  void fail_photograph(Fit last) const {
    const size_t picture = moves_.size();
    const auto fail = [&](const std::string& cause, const char* remedy) {
      throw quality_error("{}: {}", options_.place, cause).remedy(remedy);
    };
    if (last == Fit::Lost)
      fail(moved_between(picture) + ", or something hides the panel's middle",
           "photograph this place again");
    if (camera_moved())
      fail(moved_between(picture) + ", or the panel did", "photograph this place again");
    if (last == Fit::Unsettled)
      fail(fmt::format("photograph {} shows the panel between two patterns", picture + 1),
           "photograph this place again, and wait for a second after each new pattern");
    // A longer gap looks like a photograph of an earlier pattern.
    constexpr size_t kMostMissing = kMarkCounts - 2;
    for (size_t missing = 1; missing <= kMostMissing; ++missing)
      if (shows_pattern(picture + missing)) fail_missing(picture, missing);
    fail(fmt::format("photograph {} shows the marks of another pattern", picture + 1),
         "photograph every pattern once, in their order");
  }

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
