// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/capture.h"

#include <fmt/format.h>

#include <cmath>
#include <future>

#include "base/error.h"

namespace lenticule::calib {
namespace {

using std::chrono::milliseconds;

/// A camera that times out so many times in a row counts as dead.
constexpr int kMostSilences = 3;
/// Limit of pictures of one pattern, independent of their times.
constexpr int kMostPictures = 1000;
/// Additional wait after each picture that shows the panel between two patterns.
constexpr Nanoseconds kMoreSettling = milliseconds(20);

}  // namespace

PatternCapture::PatternCapture(frames::FrameSink& sink, Camera& camera, const optics::Panel& panel,
                               const CaptureOptions& options, CaptureProgress progress)
    : sink_(sink),
      camera_(camera),
      panel_(panel),
      options_(options),
      progress_(std::move(progress)) {
  const frames::FrameGeometry wanted = sink.geometry();
  if (wanted.width != panel.width_px || wanted.height != panel.height_px)
    throw Error(ErrorKind::Input,
                fmt::format("display: has {} x {} pixels, but the rig's panel has {} x {}",
                            wanted.width, wanted.height, panel.width_px, panel.height_px),
                "run the panel at its own resolution");
}

void PatternCapture::check_marks(MarkReader reader) {
  marks_ = std::move(reader);
  reference_white_ = 0.0;
}

void PatternCapture::capture(
    std::span<const Pattern> patterns,
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

void PatternCapture::capture_one(const Pattern& pattern, const frames::WovenFrame& frame) {
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

void PatternCapture::show(const frames::WovenFrame& frame) {
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

void PatternCapture::grab(Nanoseconds not_before) {
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
        throw Error(ErrorKind::Device,
                    fmt::format("camera: no picture for {} s",
                                kMostSilences * std::chrono::duration<double>(timeout).count()),
                    "check whether another program uses it");
      case GrabStatus::Gone:
        if (!options_.clocked)
          throw Error(ErrorKind::Input,
                      fmt::format("{}, and that of pattern {} of {} is missing", camera_.failure(),
                                  moves_.size() + 1, options_.patterns),
                      "photograph this place again, every pattern once and in their order");
        throw Error(ErrorKind::Device, "camera: " + camera_.failure(),
                    "nothing was written; connect the camera again and start over");
    }
  }
}

PatternCapture::Fit PatternCapture::fit_of(const Pattern& pattern, Nanoseconds earliest,
                                           double& gain) {
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

void PatternCapture::remember_marks() {
  codes_.add(reading_.code);
  moves_.push_back(marks_ ? marks_->moved(grey_of(picture_)) : Vec2{});
}

void PatternCapture::add(double gain) {
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
bool PatternCapture::shows_pattern(size_t number) const {
  const bool code_fits =
      !code_ || reading_.code == kNoCode || reading_.code == code_->of_pattern(number);
  return code_fits && reading_.mark == static_cast<int>(number % kMarkCounts);
}

void PatternCapture::fail_missing(size_t first, size_t count) const {
  const std::string which =
      count == 1 ? fmt::format("the photograph of pattern {} of {} is missing", first + 1,
                               options_.patterns)
                 : fmt::format("the photographs of patterns {} to {} of {} are missing", first + 1,
                               first + count, options_.patterns);
  throw Error(ErrorKind::Input, fmt::format("{}: {}", options_.place, which),
              "photograph this place again, every pattern once and in their order");
}

/// Returns true if the last picture shows the marks at another place than the first ones.
bool PatternCapture::camera_moved() const {
  const Vec2 moved = marks_ ? marks_->moved(grey_of(picture_)) : Vec2{};
  return std::hypot(moved.x, moved.y) > kKnockPx;
}

void PatternCapture::fail_photograph(Fit last) const {
  const size_t picture = moves_.size();
  const auto fail = [&](const std::string& cause, const char* remedy) {
    throw Error(ErrorKind::Quality, fmt::format("{}: {}", options_.place, cause), remedy);
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

void PatternCapture::fail_dropped(const Pattern& pattern, Fit last) const {
  if (!options_.clocked) return fail_photograph(last);
  if (last == Fit::Lost)
    throw Error(ErrorKind::Device, "camera: the marks in the panel's middle are no longer seen",
                "check whether the camera moved, or something hides the panel");
  if (camera_moved())
    throw Error(
        ErrorKind::Device,
        fmt::format("camera: it moved between pattern {} and {}", moves_.size(), moves_.size() + 1),
        "put it on a stand, and measure this place again");
  if (last == Fit::Unsettled)
    throw Error(ErrorKind::Device, "camera: every picture shows the panel between two patterns",
                "the exposure may be too long, or a program changes the panel's brightness");
  throw Error(ErrorKind::Device, fmt::format("camera: never sees pattern number {}", pattern.mark),
              "pictures may come late (a larger --settle-ms), or out of order");
}

}  // namespace lenticule::calib
