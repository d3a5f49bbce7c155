// SPDX-License-Identifier: Apache-2.0
// Calibration holds the result of a calibration, its uncertainty, and the verdict whether it may be
// used. Plain data: made by the fit, written into reports and rig files.
#pragma once

#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "optics/rig.h"
#include "optics/vec.h"

namespace lenticule::calib {

/// Returns the distance from which a rig is viewed; arm's length if its views are parallel.
[[nodiscard]] inline double viewing_distance_mm(const optics::Rig& rig) {
  const double z = rig.viewing.distance.value;
  return std::isfinite(z) ? z : 700.0;
}

/// Returns eyes at the borders of the viewing zone of photographs by hand: up to 250 mm to each
/// side at 0.8 to 1.2 of the viewing distance.
[[nodiscard]] inline std::vector<Vec3> zone_of(const optics::Rig& rig) {
  constexpr double kHalfWidthMm = 250.0;
  std::vector<Vec3> eyes;
  for (const double part : {0.8, 1.0, 1.2})
    for (const double side : {-1.0, 0.0, 1.0})
      eyes.push_back(
          {side * kHalfWidthMm, rig.viewing.height.value, part * viewing_distance_mm(rig)});
  return eyes;
}

/// Estimate is a value with its standard error.
struct Estimate {
  double value = 0.0;
  double sigma = 0.0;
};

struct Parameter {
  std::string name;  ///< key of the rig file: "pitch_subpx"
  std::string unit;  ///< "subpixels", "px/px", "lenses", "mm"
  Estimate estimate;
};

/// PanelField is a grid of values over the panel, rows from the top; NaN for cells without a
/// measurement. Columns and rows are cells: value (c, r) belongs to the middle of its cell.
struct PanelField {
  int columns = 0;
  int rows = 0;
  std::vector<double> values;
};

/// Viewpoint describes the contribution of one camera position.
struct Viewpoint {
  std::string name;         ///< "centre", "left", ...
  Vec3 eye_mm;              ///< the camera's pupil in the panel frame
  Vec3 eye_sigma_mm;        ///< standard errors
  double tilt_degrees = 0;  ///< angle between the camera's axis and the panel's normal
  Estimate effective_pitch_subpx;
  Estimate slant;
  Estimate effective_offset_lenses;  ///< phase at the panel's centre, seen from this viewpoint
  double contrast = 0.0;             ///< contrast of the fringes, 0 to 1, median over the panel
  double covered = 0.0;              ///< fraction of the panel that could be used
  int blocks = 0;
  double rms_lenses = 0.0;  ///< rms of the phase residuals of the fit
  double max_lenses = 0.0;
  double reprojection_rms_px = 0.0;
  bool held_out = false;  ///< excluded from the fit, only used to check it
  PanelField residual;    ///< lenses
  /// Error of the phase at this viewpoint if predicted from the other viewpoints alone: the largest
  /// mean over a cell of a 12 x 7 grid, in which noise averages out. NaN with fewer than three
  /// viewpoints.
  double predicted_lenses = std::numeric_limits<double>::quiet_NaN();
};

/// CameraModel holds the camera optics that the fit determined.
struct CameraModel {
  double focal_px = 0.0;
  double centre_x_px = 0.0;
  double centre_y_px = 0.0;
  double k1 = 0.0;
  double k2 = 0.0;
};

/// LensSpot describes the light that an eye gets from the neighbouring places under a lens.
struct LensSpot {
  std::vector<double> profile;  ///< light from place (b + 1/2)/bins - 1/2 of the lens, sums to 1
  double sigma_lenses = 0.0;    ///< sigma of the Gaussian nearest to the profile
  double two_view_crosstalk = 0.0;  ///< (L_bw - L_bb) / (L_wb - L_bb), mean over the panel
  double veiling_glare = 0.0;  ///< light where a rotated comb should give none, relative to white
};

/// LinkCheck describes the effect of the link between player and panel on subpixels.
struct LinkCheck {
  bool channels_swapped = false;   ///< red and blue: the panel is BGR
  bool chroma_subsampled = false;  ///< 4:2:0 or 4:2:2
  bool scaled = false;             ///< other pixels than the panel's own
  double chroma_leak = 0.0;  ///< light in channels that should be dark, relative to the lit channel
  std::vector<std::string> findings;  ///< sentences for users
};

enum class Verdict {
  Intrinsic,  ///< valid for every eye: P, g and offset are determined separately
  Effective,  ///< valid at the measured eye only
  Refused,    ///< must not be used
};
[[nodiscard]] const char* to_string(Verdict verdict);

/// DriftPrediction is the largest phase error over panel and eyes, predicted from the standard
/// errors.
struct DriftPrediction {
  /// At the worst panel point for the worst eye: two standard errors; for hand-held photographs the
  /// limit that 97 % of drawn errors keep.
  double worst_lenses = 0.0;
  double panel_x_px = 0.0;
  double panel_y_px = 0.0;
  Vec3 eye_mm;
};

/// SetAside is a photograph that the result does not use because it contradicts the others.
struct SetAside {
  std::string photograph;
  std::string reason;
};

struct Calibration {
  optics::Rig rig;  ///< the starting rig with the calibrated values
  Verdict verdict = Verdict::Refused;
  std::vector<std::string>
      reasons;  ///< reasons against a better verdict, one sentence each; empty when Intrinsic
  std::vector<std::string> warnings;  ///< notes for users that do not change the verdict
  std::vector<SetAside> set_aside;    ///< each also has a warning
  std::vector<Parameter> parameters;
  std::vector<std::vector<double>>
      correlations;  ///< correlations of the first parameters, in order
  std::vector<Viewpoint> viewpoints;
  CameraModel camera;
  std::optional<LensSpot> spot;
  LinkCheck link;
  DriftPrediction drift;
  /// Error of one photograph, in lenses, if it was certainly not cropped; 0 for other methods.
  double at_camera_lenses = 0.0;
  double seconds_computing = 0.0;
};

}  // namespace lenticule::calib
