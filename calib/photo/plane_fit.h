// SPDX-License-Identifier: Apache-2.0
// Fits pitch, slant, offset and residual map of the sheet to the fringes that one camera saw.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/photo/camera_from_tags.h"
#include "calib/photo/fringe_blocks.h"
#include "calib/photo/phase_plane.h"

namespace lenticule::calib {

/// Largest residual of a sheet that counts as even.
inline constexpr double kEvenLenses = 0.02;

/// PlaneFit holds the steps of the fit; after a refusal those until there.
struct PlaneFit {
  FringeSamples fringes;
  optics::Rig rig;  ///< the rig known so far
  std::vector<FringeBlock> blocks;
  PlaneCorrection correction;
  double uneven_lenses = 0.0;  ///< residual before the sheet's shape was mapped

  /// Returns the fraction of the blocks that are outliers.
  [[nodiscard]] double left_out() const;
};

/// Finds the fringes and counts them: `fit.fringes` and a first pitch and slant. Refuses
/// photographs with clipped, missing or invisible fringes.
[[nodiscard]] Refusal locate_fringes(const PhotoLight& picture, const PhotoPose& pose,
                                     const SinglePhotoChart& chart, PlaneFit& fit);

/// Fits the phases of `fit.fringes`, starting at `fit.rig`. Refuses faint fringes and those that
/// fit no even sheet.
[[nodiscard]] Refusal fit_phases(const SinglePhotoChart& chart, PlaneFit& fit);

[[nodiscard]] double median_contrast(const std::vector<FringeBlock>& blocks);

}  // namespace lenticule::calib
