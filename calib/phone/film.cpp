// SPDX-License-Identifier: Apache-2.0
#include "calib/phone/film.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

#include "base/statistics.h"

namespace lenticule::calib {
namespace {

/// Neighbours that are further apart, seconds, do not show the motion between them. One may lack.
constexpr double kFarthestNeighbours = 0.35;
constexpr double kMostTimesSharpest = 2.0;  ///< relative to that of the sharpest tenth

double blur_of(const FilmFrame& frame) {
  std::vector<double> blurs;
  for (const TagSighting& tag : frame.found.tags)
    if (tag.blur_px > 0.0) blurs.push_back(tag.blur_px);
  return blurs.empty() ? 1e9 : upper_median(std::move(blurs));
}

Eigen::Matrix3d rotation_of(const PhotoPose& pose) {
  const auto& m = pose.panel_from_camera;
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(m.data());
}

/// Returns the focal length of the film, in pixels of the averaged pictures: frames from the side
/// show it, those from straight ahead only what their priors say.
double focal_of(const std::vector<const FilmFrame*>& frames) {
  constexpr double kAside = 15.0;  // degrees
  std::vector<double> all, aside;
  for (const FilmFrame* frame : frames) {
    all.push_back(frame->found.pose->focal_px);
    if (frame->found.pose->tilt_degrees > kAside) aside.push_back(all.back());
  }
  return upper_median(aside.size() >= 3 ? std::move(aside) : std::move(all));
}

/// Returns the mean motion between two frames. Computes both poses with one focal length and axis:
/// separate ones would differ by their errors, which look like motion.
std::optional<PhotoMotion> motion_between(const FilmFrame& before, const FilmFrame& after,
                                          const SinglePhotoChart& chart, double focal_px) {
  PhotoPriors camera{.focal_px = Estimate{focal_px, 0.001 * focal_px}, .axis_sigma = 3e-4};
  const double distance = viewing_distance_mm(chart.start);
  camera.distance_mm = {distance, distance};
  const auto pose_of = [&](const PhotoFindings& found) {
    return find_pose(found.tags, chart, found.width, found.height, camera);
  };
  const auto from = pose_of(before.found), to = pose_of(after.found);
  if (!from || !to) return std::nullopt;
  const double per_s = 1.0 / (after.seconds - before.seconds);
  const Eigen::AngleAxisd turn(rotation_of(*from).transpose() * rotation_of(*to));
  // A pose has y up and looks along -z.
  const Eigen::Vector3d w = turn.axis() * (turn.angle() * per_s);
  return PhotoMotion{(to->eye_mm - from->eye_mm) * per_s, {w.x(), -w.y(), -w.z()}};
}

/// Returns the distance of two places as seen from the panel.
double apart(const FilmFrame& one, const FilmFrame& other) {
  const Vec3 &a = one.found.pose->eye_mm, &b = other.found.pose->eye_mm;
  return std::hypot(a.x / a.z - b.x / b.z, a.y / a.z - b.y / b.z, std::log(a.z / b.z));
}

/// Returns how fast tags move in the picture: the median, longer sides a second.
double speed_in_picture(const std::vector<FilmFrame>& frames) {
  std::vector<double> speeds;
  for (size_t n = 1; n < frames.size(); ++n)
    for (const TagSighting& tag : frames[n].found.tags) {
      const PhotoFindings& before = frames[n - 1].found;
      const auto same = std::ranges::find(before.tags, tag.id, &TagSighting::id);
      if (same == before.tags.end()) continue;
      const Vec2 moved = tag.corners_px[0] - same->corners_px[0];
      speeds.push_back(std::hypot(moved.x, moved.y) / std::max(before.width, before.height) /
                       (frames[n].seconds - frames[n - 1].seconds));
    }
  return speeds.empty() ? 0.0 : upper_median(std::move(speeds));
}

/// Returns the most frequent reason why frames do not show the whole chart.
std::string usual_refusal(const std::vector<FilmFrame>& frames) {
  std::map<std::string, size_t> reasons;
  for (const FilmFrame& frame : frames)
    if (!frame.found.refusal.empty()) ++reasons[frame.found.refusal];
  if (reasons.empty()) return "tags at its border are cut or covered";
  return std::ranges::max_element(reasons, {}, [](const auto& one) { return one.second; })->first;
}

/// Returns why the frames cannot be used; empty if they can. `chosen` are indices.
std::string film_refusal(const std::vector<FilmFrame>& frames, size_t whole,
                         const std::vector<size_t>& chosen) {
  constexpr double kShortest = 3.0, kFastest = 0.5, kLeastSpread = 0.5;
  constexpr size_t kLeastFrames = 6;
  const double seconds = frames.empty() ? 0.0 : frames.back().seconds - frames.front().seconds;
  if (seconds < kShortest)
    return fmt::format("the film is too short, {:.1f} s: move the phone for 5 to 30 s", seconds);
  if (seconds > kLongestFilmSeconds)
    return fmt::format("the film is longer than {:.0f} s: move the phone for 5 to 30 s",
                       kLongestFilmSeconds);
  if (chosen.size() < kLeastFrames) {
    const std::string begin = fmt::format(
        "only {} of {} frames show the whole chart sharply: ", chosen.size(), frames.size());
    if (const double speed = speed_in_picture(frames); speed > kFastest)
      return begin + fmt::format(
                         "the phone moves too fast, the chart crosses the picture in {:.1f} "
                         "s; take 5 s or more from one side to the other",
                         1.0 / speed);
    if (whole == 0)
      return fmt::format("none of {} frames shows the whole chart of this rig: {}", frames.size(),
                         usual_refusal(frames));
    return begin + (whole < kLeastFrames ? usual_refusal(frames) : "move the phone more slowly");
  }
  double spread = 0.0;
  for (const size_t one : chosen)
    for (const size_t other : chosen) spread = std::max(spread, apart(frames[one], frames[other]));
  if (spread < kLeastSpread)
    return fmt::format(
        "all frames are from nearly one place, {:.0f} degrees apart: move the phone from a step at "
        "the left, past the middle, to a step at the right",
        std::atan(spread) * 180.0 / std::numbers::pi);
  return {};
}

}  // namespace

FilmChoice choose_frames(const std::vector<FilmFrame>& frames, const SinglePhotoChart& chart) {
  FilmChoice out;
  const auto is_whole = [&chart](const FilmFrame& frame) {
    return frame.found.refusal.empty() && frame.found.tags.size() == chart.tags.size();
  };
  std::vector<double> blurs;
  std::vector<const FilmFrame*> whole;
  for (const FilmFrame& frame : frames)
    if (is_whole(frame)) {
      blurs.push_back(blur_of(frame));
      whole.push_back(&frame);
    }
  out.whole = whole.size();
  if (whole.empty()) {
    out.refusal = film_refusal(frames, 0, {});
    return out;
  }
  const double most_blur = kMostTimesSharpest * value_in_order(blurs, blurs.size() / 10);
  const double focal_px = focal_of(whole);
  constexpr double kFocalSigma = 0.05;
  const int averaged = whole.front()->found.averaged;
  out.focal_px = Estimate{averaged * focal_px, kFocalSigma * averaged * focal_px};
  std::vector<size_t> usable, chosen;
  for (size_t n = 1; n + 1 < frames.size(); ++n)
    if (is_whole(frames[n]) && frames[n - 1].found.pose && frames[n + 1].found.pose &&
        frames[n + 1].seconds - frames[n - 1].seconds <= kFarthestNeighbours &&
        blur_of(frames[n]) <= most_blur)
      usable.push_back(n);
  out.sharp = usable.size();
  std::vector<size_t> rest = usable;
  while (!rest.empty() && chosen.size() < kMostFilmFrames) {
    // The first is the one farthest from where the film begins.
    const auto distance = [&](size_t n) {
      double least = chosen.empty() ? apart(frames[n], frames[usable.front()]) : 1e9;
      for (const size_t other : chosen) least = std::min(least, apart(frames[n], frames[other]));
      return least;
    };
    const auto next = std::ranges::max_element(rest, {}, distance);
    chosen.push_back(*next);
    rest.erase(next);
  }
  std::ranges::sort(chosen);
  out.refusal = film_refusal(frames, out.whole, chosen);
  if (!out.refusal.empty()) return out;
  for (const size_t n : chosen)
    if (const auto motion = motion_between(frames[n - 1], frames[n + 1], chart, focal_px))
      out.frames.push_back({n, *motion});
  return out;
}

}  // namespace lenticule::calib
