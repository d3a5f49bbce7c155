// SPDX-License-Identifier: Apache-2.0
// Calibrates from a single photograph of the chart, taken from the viewer's eye position.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "calib/calibration.h"
#include "calib/camera.h"
#include "calib/photo/fringe_blocks.h"
#include "calib/photo/tag_chart.h"

namespace lenticule::calib {

/// PlaneCorrection is the correction of the lens plane that blocks were measured against.
struct PlaneCorrection {
  LensPlane add;
  /// Covariance of add.at, add.across and add.down, row by row, from the scatter of the blocks.
  std::array<double, 9> covariance{};
  std::vector<double> residuals;  ///< phase residual per block, lenses
  double rms_lenses = 0.0;        ///< weighted, of blocks that are not outliers
  double max_lenses = 0.0;        ///< largest residual of blocks that are not outliers
  int used = 0;                   ///< number of blocks that are not outliers
};

/// Returns the plane with the largest sum of the phasors of all blocks: accurate to a fraction of a
/// fringe if the start was accurate to one and a half fringes across the panel.
[[nodiscard]] LensPlane search_plane(const std::vector<FringeBlock>& blocks);

/// Fits the blocks' phases, which must be within half a fringe, by robust weighted least squares.
/// The unknowns are the plane and a smooth error of position (a cubic polynomial), which shifts the
/// fringes of each band in proportion to its detuning. Uses no block unless there are at least 20.
[[nodiscard]] PlaneCorrection fit_plane(const std::vector<FringeBlock>& blocks);

// Computes the sheet's residual map from the residuals of a plane fit.

/// Returns a residual map of 13 by 8 knots that smooths -residuals[i] of each block. Every knot is
/// the value of a plane fitted to the blocks around it; near blocks get a larger weight, outliers a
/// smaller one, and knots on the panel's border extrapolate the sheet. Returns an empty map for
/// fewer than 100 blocks.
[[nodiscard]] optics::ResidualMap smooth_map(const std::vector<FringeBlock>& blocks,
                                             const std::vector<double>& residuals);

/// Returns the sum of both maps, with as many knots as the finer map; between its knots the coarser
/// map is interpolated as in the optical model. Either map may be empty.
[[nodiscard]] optics::ResidualMap sum_of_maps(const optics::ResidualMap& a,
                                              const optics::ResidualMap& b);

/// Returns observed minus fitted lenses of each block, else NaN: fringes have the opposite sign.
[[nodiscard]] PanelField residual_field(int columns, int rows,
                                        const std::vector<FringeBlock>& blocks,
                                        const std::vector<double>& residuals);

/// PhotoMotion is how the camera moved while a frame of a film was taken.
struct PhotoMotion {
  Vec3 mm_s;       ///< velocity of the pupil in the panel's frame
  Vec3 radians_s;  ///< rotation about the camera's axes: right, down, forward
};

/// PhotoFindings is what one photograph of the chart shows, for a fit of several photographs.
struct PhotoFindings {
  std::string refusal;  ///< reason why the photograph cannot be used; empty if it can
  int averaged = 1;     ///< side of the square of its pixels that became one pixel below
  int width = 0;        ///< size of the averaged picture
  int height = 0;
  std::vector<TagSighting> tags;    ///< corners are in pixels of the averaged picture
  std::optional<PhotoPose> pose;    ///< from this photograph alone
  optics::Rig rig;                  ///< pitch, slant, offset and map for this pose alone
  std::vector<FringeBlock> blocks;  ///< deviations from that rig
  int columns = 0, rows = 0;        ///< numbers of blocks across and down the panel
  double contrast = 0.0;
  double covered = 0.0;
  double saturated = 0.0;  ///< fraction of the values on the panel that were clipped
  std::optional<PhotoMotion> motion = {};  ///< set for frames of a film only
};

/// Measures a photograph as fit_single_photo() does; with `only_tags` no fringes, which is faster.
[[nodiscard]] PhotoFindings measure_photo(const CameraPicture& photograph,
                                          const SinglePhotoChart& chart,
                                          const PhotoPriors& priors = {}, bool only_tags = false);

/// Finds tags, camera and fringes, and computes pitch, slant and offset for this eye. The verdict
/// is Effective, or Refused with the reasons: too few tags, too few or too faint fringes, clipped
/// light, phases that fit no plane. Throws nothing for the content of a picture.
///
/// The viewpoint has the values of docs/panel/optics.md: effective pitch P (1 + g/Ez), the phase at
/// the panel's centre, the residual per block. The rig has the pitch, slant and offset that give
/// these values for this eye with the gap of the chart's rig, a residual map if residuals exceed
/// 0.02 lenses without one, and a viewing line through the eye. camera.k1 is the outward
/// displacement of a point one focal length off the axis.
///
/// One photograph takes at most a second and some hundred megabytes: larger ones are averaged down
/// to 2600 pixels along their longer side.
///
/// Thread safety: any thread; starts no threads.
[[nodiscard]] Calibration fit_single_photo(const CameraPicture& photograph,
                                           const SinglePhotoChart& chart,
                                           const PhotoPriors& priors = {});

}  // namespace lenticule::calib
