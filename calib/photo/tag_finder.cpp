// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/tag_finder.h"

#include <apriltag/apriltag.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <utility>

#include "base/error.h"
#include "base/statistics.h"
#include "calib/photo/tag_alignment.h"
#include "calib/photo/tag_family.h"

namespace lenticule::calib {
namespace {

struct Release {
  void operator()(image_u8_t* picture) const { image_u8_destroy(picture); }
  void operator()(apriltag_detector_t* detector) const { apriltag_detector_destroy(detector); }
  void operator()(zarray_t* detections) const { apriltag_detections_destroy(detections); }
};
template <class T>
using Owned = std::unique_ptr<T, Release>;

/// Returns the light that a two hundredth of the pixels exceeds: white, even with glints.
float white_level(const PhotoLight& picture) {
  std::vector<float> light;
  for (const float value : picture.light)
    if (std::isfinite(value)) light.push_back(value);
  if (light.empty()) return 1.0F;
  const size_t place = light.size() - 1 - light.size() / 200;
  return std::max(value_in_order(std::move(light), place), 1e-6F);
}

/// Converts to eight bits of linear light: another curve would move the edges of blurred tags.
Owned<image_u8_t> eight_bits(const PhotoLight& picture) {
  Owned<image_u8_t> out(
      image_u8_create(static_cast<unsigned>(picture.width), static_cast<unsigned>(picture.height)));
  LENTICULE_CHECK(out != nullptr);
  const float white = white_level(picture);
  for (int j = 0; j < picture.height; ++j) {
    for (int i = 0; i < picture.width; ++i) {
      const float light =
          picture.light[static_cast<size_t>(j) * static_cast<size_t>(picture.width) +
                        static_cast<size_t>(i)];
      const float share = light > 0.0F ? std::min(light / white, 1.0F) : 0.0F;  // NaN: black
      out->buf[j * out->stride + i] = static_cast<uint8_t>(std::lround(255.0F * share));
    }
  }
  return out;
}

TagSighting sighting_of(const apriltag_detection_t& detection) {
  TagSighting sighting;
  sighting.id = detection.id;
  for (size_t corner = 0; corner < 4; ++corner)
    sighting.corners_px[corner] = {detection.p[corner][0], detection.p[corner][1]};
  return sighting;
}

bool is_credible(const apriltag_detection_t& detection) {
  constexpr int kMostWrongBits = 1;
  constexpr float kLeastMargin = 15.0F;
  return detection.id >= 0 && detection.id < kTagIds && detection.hamming <= kMostWrongBits &&
         detection.decision_margin >= kLeastMargin;
}

/// Best holds the clearest sighting of each tag.
using Best = std::map<int, std::pair<float, TagSighting>>;

Best detect(apriltag_detector_t& detector, image_u8_t& picture) {
  const Owned<zarray_t> found(apriltag_detector_detect(&detector, &picture));
  Best best;
  for (int i = 0; found && i < zarray_size(found.get()); ++i) {
    apriltag_detection_t* detection = nullptr;
    zarray_get(found.get(), i, &detection);
    if (!is_credible(*detection)) continue;
    auto& [margin, sighting] = best[detection->id];
    if (margin >= detection->decision_margin) continue;
    margin = detection->decision_margin;
    sighting = sighting_of(*detection);
  }
  return best;
}

}  // namespace

std::vector<TagSighting> find_tags(const PhotoLight& picture, size_t wanted) {
  constexpr int kLeastSide = 32;  // the library requires a minimum size
  if (picture.width < kLeastSide || picture.height < kLeastSide) return {};
  const TagFamily family;  // outlives its detector
  const Owned<apriltag_detector_t> detector(apriltag_detector_create());
  LENTICULE_CHECK(detector != nullptr);
  apriltag_detector_add_family_bits(detector.get(), family.get(), 1);
  detector->nthreads = 1;
  detector->quad_decimate = 1.0F;
  const Owned<image_u8_t> grey = eight_bits(picture);
  Best all;
  // The sharp picture is searched first; tags hidden by noise are searched in blurred pictures.
  // Corners are always refined in the sharp picture.
  for (const float blur_px : {0.0F, 0.8F, 1.6F, 2.4F}) {
    detector->quad_sigma = blur_px;
    all.merge(detect(*detector, *grey));
    if (all.size() >= wanted) break;
  }
  std::vector<TagSighting> tags;
  for (const auto& [id, sighting] : all)
    tags.push_back(aligned(picture, sighting.second, family.cells(id)));
  return tags;
}

}  // namespace lenticule::calib
