// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/camera_from_tags.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/statistics.h"

namespace lenticule::calib {
namespace {

constexpr size_t kLeastTags = 5;
constexpr double kMisplacedPx = 1.5;

/// Removes tags that are partly hidden: they are found, but at a wrong position.
std::vector<TagSighting> without_misplaced(const TaggedCamera& camera) {
  const double most = std::max(4.0 * upper_median(camera.pose->tag_off_px), kMisplacedPx);
  std::vector<TagSighting> kept;
  for (size_t i = 0; i < camera.tags.size(); ++i)
    if (camera.pose->tag_off_px[i] <= most) kept.push_back(camera.tags[i]);
  return kept;
}

/// Returns the part of the picture's longer side that the tags extend over.
double extent_of_tags(const AveragedPhoto& photo, const TaggedCamera& camera) {
  Vec2 least{1e9, 1e9}, most{-1e9, -1e9};
  for (const TagSighting& tag : camera.tags)
    for (const Vec2& corner : tag.corners_px) {
      least = {std::min(least.x, corner.x), std::min(least.y, corner.y)};
      most = {std::max(most.x, corner.x), std::max(most.y, corner.y)};
    }
  return std::max(most.x - least.x, most.y - least.y) /
         std::max(photo.light.width, photo.light.height);
}

/// Returns a refusal if the given camera data contradict the tags. Few pixels determine the camera
/// badly, so that a distance appears as another contradiction.
Refusal contradiction(const AveragedPhoto& photo, const TaggedCamera& camera,
                      const SinglePhotoChart& chart, const PhotoPriors& priors) {
  constexpr double kMostPull = 4.0, kLeastExtent = 0.3;
  const bool contradicts =
      camera.pose->axis_pull > kMostPull ||
      (priors.focal_px && priors.distance_mm && camera.pose->prior_pull > kMostPull);
  if (!contradicts) return std::nullopt;
  if (const double extent = extent_of_tags(photo, camera); extent < kLeastExtent)
    return fmt::format(
        "the chart takes only {:.0f} % of the picture's longer side: it was taken from "
        "too far away; go nearer",
        100.0 * extent);
  if (camera.pose->axis_pull > kMostPull) {
    const Vec2 off =
        (camera.pose->middle_px - Vec2{0.5 * photo.light.width, 0.5 * photo.light.height}) *
        photo.averaged;
    return fmt::format(
        "the camera's axis is {:.0f} pixels to the side and {:.0f} down from the middle of the "
        "picture: it was cropped; give the whole photograph",
        off.x, off.y);
  }
  const auto found_without = [&](auto forget) {
    PhotoPriors fewer = photo.scaled(priors);
    forget(fewer);
    return find_pose(camera.tags, chart, photo.light.width, photo.light.height, fewer);
  };
  const auto by_focal = found_without([](PhotoPriors& p) { p.distance_mm.reset(); });
  const auto by_distance = found_without([](PhotoPriors& p) { p.focal_px.reset(); });
  if (!by_focal || !by_distance) return "distance and focal length contradict the tags";
  return fmt::format(
      "distance and focal length contradict the picture: {:.0f} pixels of focal length give this "
      "picture of the tags from {:.0f} mm, not {:.0f} mm, and at that distance the focal length "
      "would be {:.0f} pixels; if both are right the panel's size in the rig is wrong by {:.0f} %",
      priors.focal_px->value, by_focal->eye_mm.z, priors.distance_mm->value,
      by_distance->focal_px * photo.averaged,
      100.0 * std::abs(by_focal->eye_mm.z / priors.distance_mm->value - 1.0));
}

Refusal place_camera(const AveragedPhoto& photo, const SinglePhotoChart& chart,
                     const PhotoPriors& priors, TaggedCamera& camera) {
  const auto try_tags = [&] {
    camera.pose =
        find_pose(camera.tags, chart, photo.light.width, photo.light.height, photo.scaled(priors));
  };
  try_tags();
  if (camera.pose) {
    const std::vector<TagSighting> kept = without_misplaced(camera);
    if (kept.size() >= kLeastTags && kept.size() < camera.tags.size()) {
      camera.tags = kept;
      try_tags();
    }
  }
  if (!camera.pose) return "the tags fit no place of a camera in front of the panel";
  if (Refusal refusal = contradiction(photo, camera, chart, priors)) return refusal;
  constexpr double kMostCornerPx = 3.0;
  if (camera.pose->corner_rms_px > kMostCornerPx)
    return fmt::format(
        "the tags deviate by {:.1f} pixels from a flat panel seen through a simple lens",
        camera.pose->corner_rms_px);
  return std::nullopt;
}

/// Returns true if tags of the chart appear when the picture is mirrored.
bool is_mirrored(const PhotoLight& picture, const SinglePhotoChart& chart) {
  PhotoLight mirrored{picture.width, picture.height, picture.light};
  for (int row = 0; row < mirrored.height; ++row) {
    const auto begin = mirrored.light.begin() + static_cast<ptrdiff_t>(row) * mirrored.width;
    std::reverse(begin, begin + mirrored.width);
  }
  const std::vector<TagSighting> tags = find_tags(mirrored, kLeastTags);
  return std::ranges::count_if(tags, [&](const TagSighting& tag) {
           return chart.tag(tag.id) != nullptr;
         }) >= static_cast<ptrdiff_t>(kLeastTags);
}

}  // namespace

Refusal locate_camera(const AveragedPhoto& photo, const SinglePhotoChart& chart,
                      const PhotoPriors& priors, TaggedCamera& camera) {
  camera.tags = find_tags(photo.light, chart.tags.size());
  const size_t foreign = std::erase_if(
      camera.tags, [&](const TagSighting& tag) { return chart.tag(tag.id) == nullptr; });
  if (camera.tags.size() < kLeastTags && foreign >= kLeastTags)
    return "the chart in the photograph was made for another rig";
  if (camera.tags.size() < kLeastTags && is_mirrored(photo.light, chart))
    return "the photograph is mirrored: switch off the camera program's mirroring, or take the "
           "phone's back camera";
  if (camera.tags.size() < kLeastTags)
    return fmt::format(
        "only {} of {} tags were found: the panel is not completely in the picture, too small, or "
        "out of focus",
        camera.tags.size(), chart.tags.size());
  return place_camera(photo, chart, priors, camera);
}

}  // namespace lenticule::calib
