// SPDX-License-Identifier: Apache-2.0
// Locates the camera of a photograph by the tags of the chart.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/photo/averaged_photo.h"
#include "calib/photo/photo_pose.h"
#include "calib/photo/tag_chart.h"
#include "calib/photo/tag_finder.h"

namespace lenticule::calib {

/// Refusal is the reason why a photograph cannot be used, or nothing.
using Refusal = std::optional<std::string>;

struct TaggedCamera {
  std::vector<TagSighting> tags;
  std::optional<PhotoPose> pose;
};

/// Finds tags and pose. Refuses photographs with too few tags, with tags of another rig's chart,
/// mirrored ones, and those whose tags contradict the priors or a flat panel; `camera` then has
/// the results until there.
[[nodiscard]] Refusal locate_camera(const AveragedPhoto& photo, const SinglePhotoChart& chart,
                                    const PhotoPriors& priors, TaggedCamera& camera);

}  // namespace lenticule::calib
