// SPDX-License-Identifier: Apache-2.0
// What a calibration found, how sure it is, and whether it may be trusted. Plain data: made by the
// fit, written into reports and rig files.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "optics/rig.h"
#include "optics/vec.h"

namespace lenticule::calib {

/// A value with its standard error.
struct Estimate {
  double value = 0.0;
  double sigma = 0.0;
};

struct Parameter {
  std::string name;  ///< as in the rig file: "pitch_subpx"
  std::string unit;  ///< "subpixels", "px/px", "lenses", "mm"
  Estimate estimate;
};

/// A grid of values over the panel, rows from the top; NaN where nothing was measured. Columns and
/// rows are cells: value (c, r) stands for the middle of its cell.
struct PanelField {
  int columns = 0;
  int rows = 0;
  std::vector<double> values;
};

/// What one place of the camera contributed.
struct Viewpoint {
  std::string name;         ///< "centre", "left", ...
  Vec3 eye_mm;              ///< the camera's pupil in the panel frame
  Vec3 eye_sigma_mm;        ///< standard errors
  double tilt_degrees = 0;  ///< between the camera's axis and the panel's normal
  Estimate effective_pitch_subpx;
  Estimate slant;
  Estimate effective_offset_lenses;  ///< phase at the panel's centre, seen from here
  double contrast = 0.0;             ///< of the fringes, 0 to 1, median over the panel
  double covered = 0.0;              ///< part of the panel that could be used
  int blocks = 0;
  double rms_lenses = 0.0;  ///< of the phase left over after the fit
  double max_lenses = 0.0;
  double reprojection_rms_px = 0.0;
  bool held_out = false;  ///< not used by the fit, only to check it
  PanelField residual;    ///< lenses
  /// How far off the other viewpoints alone foretell the phase here, at worst of the means over 12
  /// x 7 cells, which noise hardly reaches. NaN with fewer than three viewpoints.
  double foretold_lenses = std::numeric_limits<double>::quiet_NaN();
};

/// Camera optics found on the way.
struct CameraModel {
  double focal_px = 0.0;
  double centre_x_px = 0.0;
  double centre_y_px = 0.0;
  double k1 = 0.0;
  double k2 = 0.0;
};

/// Light of the neighbouring places under a lens.
struct LensSpot {
  std::vector<double> profile;  ///< light from place (b + 1/2)/bins - 1/2 of the lens, sums to 1
  double sigma_lenses = 0.0;    ///< of the Gaussian nearest to the profile
  double two_view_crosstalk = 0.0;  ///< (L_bw - L_bb) / (L_wb - L_bb), mean over the panel
  double veiling_glare = 0.0;       ///< light where a turned comb leaves none, part of white
};

/// What the link between player and panel does to subpixels.
struct LinkCheck {
  bool channels_swapped = false;   ///< red and blue: the panel is BGR
  bool chroma_subsampled = false;  ///< 4:2:0 or 4:2:2
  bool scaled = false;             ///< not the panel's own pixels
  double chroma_leak = 0.0;        ///< light in channels that should be dark, part of the lit one
  std::vector<std::string> findings;  ///< sentences for people
};

enum class Verdict {
  Intrinsic,  ///< good for every eye: P, g and offset are told apart
  Effective,  ///< good at the measured eye only
  Refused,    ///< must not be used
};
[[nodiscard]] const char* to_string(Verdict verdict);

/// How far the phase is off at worst, over panel and eyes, predicted from the standard errors.
struct DriftPrediction {
  double worst_lenses = 0.0;  ///< two standard errors, at the worst place for the worst eye
  double panel_x_px = 0.0;
  double panel_y_px = 0.0;
  Vec3 eye_mm;
};

struct Calibration {
  optics::Rig rig;  ///< as it started, with what was found
  Verdict verdict = Verdict::Refused;
  std::vector<std::string> reasons;   ///< why not better, one sentence each; empty when Intrinsic
  std::vector<std::string> warnings;  ///< what people should know though it holds
  std::vector<Parameter> parameters;
  std::vector<std::vector<double>> correlations;  ///< of the first parameters, in order
  std::vector<Viewpoint> viewpoints;
  CameraModel camera;
  std::optional<LensSpot> spot;
  LinkCheck link;
  DriftPrediction drift;
  double seconds_computing = 0.0;
};

}  // namespace lenticule::calib
