// SPDX-License-Identifier: Apache-2.0
// Measures the fringes of a photographed chart, block by block.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "calib/calibration.h"
#include "calib/photo/tag_chart.h"
#include "optics/vec.h"

namespace lenticule::calib {

// PhotoPose is the camera position of a single photograph; it gives the points of the sheet and of
// the panel that each pixel sees.

/// SheetPoint is the point that one pixel sees, in panel pixels (X right, Y down).
struct SheetPoint {
  Vec2 lens_px;   ///< L, on the lens-apex plane
  Vec2 panel_px;  ///< Q = L - Delta(L, E), the panel point that the eye sees there
};

/// PhotoPose is a camera with its optical axis near the middle of its picture and one distortion
/// term: a pixel at (u, v) focal lengths from the axis looks along (u, v) (1 + k (u^2 + v^2)).
struct PhotoPose {
  double focal_px = 0.0;
  double distortion = 0.0;                    ///< k
  Vec2 middle_px;                             ///< position of the axis
  std::array<double, 9> panel_from_camera{};  ///< rotation, row by row
  Vec3 eye_mm;                                ///< E, the camera's pupil in the panel frame
  Vec3 eye_sigma_mm;                          ///< standard errors, if the priors are correct
  /// Covariance of the eye, row by row, under weak priors for everything that the picture cannot
  /// contradict: the axis may be a tenth of the longer side off the middle (a cropped picture), and
  /// a distance or a focal length without other confirmation may be a tenth off.
  std::array<double, 9> doubted_eye{};
  /// The same if the picture is as the phone took it, whose axis is near the middle.
  std::array<double, 9> uncropped_eye{};
  /// Distance of the priors from the fit, in their joint standard errors.
  double prior_pull = 0.0;
  double axis_pull = 0.0;     ///< the same for the prior of the axis
  double tags_larger = 0.0;   ///< relative enlargement of the tags by blur
  double tilt_degrees = 0.0;  ///< angle between the axis and the panel's normal
  double corner_rms_px = 0.0;
  std::vector<double>
      tag_off_px;  ///< largest error of each tag's corners, in the order of the tags

  /// Returns the point that a pixel sees; nothing if the pixel looks past the panel's plane.
  [[nodiscard]] std::optional<SheetPoint> seen_point(Vec2 pixel, const optics::Rig& rig) const;
};

/// PhotoPriors holds prior knowledge about the camera, with its standard error.
struct PhotoPriors {
  std::optional<Estimate> focal_px;     ///< else 0.85 of the longer side within a factor of 1.5
  std::optional<Estimate> distance_mm;  ///< else the chart's viewing distance, within 10 %
  /// Standard deviation of the camera's axis from the middle of its picture, in longer sides.
  double axis_sigma = 0.015;
};

/// Fits the pose by least squares to the tags' corners, which the sheet displaces according to the
/// rig. A photograph from straight ahead cannot separate focal length and distance: there the
/// priors decide, and eye_sigma_mm shows the uncertainty. Returns nothing if the fit does not
/// converge to a camera in front of the panel. Needs at least four tags, all of them the chart's.
[[nodiscard]] std::optional<PhotoPose> find_pose(const std::vector<TagSighting>& tags,
                                                 const SinglePhotoChart& chart, int width,
                                                 int height, const PhotoPriors& priors);

/// LensPlane is the lens coordinate over the sheet without its residual map: at + across x + down y
/// with x = (L_x - W/2) / W and y = (L_y - H/2) / H.
struct LensPlane {
  double at = 0.0;      ///< phi0
  double across = 0.0;  ///< 3 W / P
  double down = 0.0;    ///< 3 m H / P
};
[[nodiscard]] LensPlane plane_of(const optics::Rig& rig);
/// Returns the rig with the plane's pitch, slant and offset.
[[nodiscard]] optics::Rig with_plane(optics::Rig rig, const LensPlane& plane);

/// FringeSample is a pixel that sees fringes. Single precision: its rounding error is below 1e-4
/// lens and differs from pixel to pixel.
struct FringeSample {
  float x = 0.0F;  ///< position on the lens plane, in LensPlane's coordinates
  float y = 0.0F;
  float panel_x_px = 0.0F;
  float panel_y_px = 0.0F;
  float light = 0.0F;
  uint32_t block = 0;
  float pixel_x = 0.0F;  ///< position in the picture
  float pixel_y = 0.0F;
  std::array<float, 3> colours{};  ///< light of red, green and blue
};

/// FringeSamples holds the samples of blocks in rows and columns over the panel, each block within
/// one band.
struct FringeSamples {
  int columns = 0;
  int rows = 0;
  std::vector<FringeSample> samples;
  double saturated = 0.0;  ///< fraction of the values on the panel that were clipped
  double covered = 0.0;    ///< fraction of the panel's fringes that the picture shows
  /// Light of the chart's squares of one pixel relative to the grey beside them, the larger value
  /// of the patches; nothing if no patch is visible. Scaling darkens both patches, to about a half.
  /// In one alone, the squares can beat with the camera's pixels and seem darker.
  std::optional<double> squares = {};

  [[nodiscard]] int band_of(uint32_t block, int bands) const {
    return static_cast<int>(block) / columns * bands / rows;
  }
};

/// Returns the pixels that see fringes, without tags and without the borders of bands.
[[nodiscard]] FringeSamples collect_fringes(const PhotoLight& picture, const PhotoPose& pose,
                                            const SinglePhotoChart& chart);

/// FringeBlock is the deviation of the fringes of one block from the prediction of a lens plane.
struct FringeBlock {
  uint32_t block = 0;
  double detuning = 1.0;  ///< d of its band
  double x = 0.0;         ///< mean position, in LensPlane's coordinates
  double y = 0.0;
  Vec2 pixel;          ///< mean position in the picture
  double phase = 0.0;  ///< observed minus predicted fringes, cycles in [-1/2, 1/2]
  /// Phase of red, green and blue minus `phase`: the sheet refracts colours differently. 0 for grey
  /// pictures.
  std::array<double, 3> colour_phase{};
  double contrast = 0.0;  ///< amplitude over mean light
  double weight = 0.0;    ///< inverse variance of the phase
};

/// LightSums holds the normal equations of the light of some samples, which is mean + slope_x u +
/// slope_y v + c cos + s sin. Right sides: the mean of the channels, red, green, blue, then the
/// places x, y and in the picture, of which only the sums count.
struct LightSums {
  static constexpr int kLightTerms = 5, kSides = 8;
  std::array<double, kLightTerms * kLightTerms> normal{};  ///< the first is the number of samples
  std::array<double, kLightTerms * kSides> right{};
};

/// FringeSums has the sums over parts of blocks so small that in each the fringes of a similar rig
/// are ahead by one phase: samples are visited once for many rigs.
struct FringeSums {
  optics::Rig rig;  ///< predicts the fringes
  int columns = 0, rows = 0;
  std::vector<LightSums> parts;  ///< those of the first block, then of the next
};
[[nodiscard]] FringeSums sum_fringes(const FringeSamples& fringes, const SinglePhotoChart& chart,
                                     const optics::Rig& rig);

/// Fits mean, slopes, cosine and sine to the light of each block with enough pixels by least
/// squares, so that neither uneven light nor incomplete fringes bias the phase. Omits blocks too
/// small to separate their fringes from uneven light. `rig` has the residual map, and is similar to
/// that of the sums.
[[nodiscard]] std::vector<FringeBlock> measure_blocks(const FringeSums& sums,
                                                      const SinglePhotoChart& chart,
                                                      const optics::Rig& rig);

// Counts the fringes of a photographed chart from scratch, even if the starting pitch was wrong.

/// FringeCount is the result of the spectrum.
struct FringeCount {
  /// Additional lenses across and down the panel, relative to the chart's starting rig; whole
  /// numbers, refined to a position between them.
  Vec2 more_lenses;
  /// Prominence of the fringes above chance level: the geometric mean over the kinds of bands; a
  /// kind whose fringes are not visible under this answer counts as chance level.
  double prominence = 0.0;
};

/// An answer below this prominence is not better than chance.
inline constexpr double kLeastProminence = 6.0;

/// Returns the change of pitch and slant, within 12 % of the lenses, under which all kinds of bands
/// have fringes in their spectrum: a single kind cannot distinguish fringes from mirrored fringes.
[[nodiscard]] FringeCount count_fringes(const FringeSamples& fringes,
                                        const SinglePhotoChart& chart);

}  // namespace lenticule::calib
