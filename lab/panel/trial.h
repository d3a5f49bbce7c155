// SPDX-License-Identifier: Apache-2.0
// Trial is a whole calibration on the simulated bench, with the errors of its result relative to
// the ground truth; random trials draw realistic sheets, cameras and links.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "calib/fit/calibrate.h"
#include "lab/panel/portable_random.h"
#include "lab/panel/simulated_bench.h"
#include "lab/panel/simulated_setup.h"
#include "optics/panel.h"

namespace lenticule::lab {

/// TrialViewpoint is a position of the camera.
struct TrialViewpoint {
  std::string name;
  Vec3 position_mm;
  Vec3 look_at_mm;
  double roll_degrees = 0.0;
};

struct Trial {
  optics::Panel panel;
  SimulatedSheet sheet;
  SimulatedPanelLink link;
  SimulatedCamera camera;
  std::vector<TrialViewpoint> viewpoints;
  /// The starting rig of the calibration; its panel is the one above.
  optics::Rig start;
  calib::CaptureOptions capture{.average = 1};
  calib::CalibrateOptions options;
  bool link_and_spot = true;
  bool single_too = true;  ///< true: also calibrate from the first viewpoint alone
  uint64_t seed = 1;
  /// Called before each viewpoint and before each pattern of it, to inject faults.
  std::function<void(SimulatedBench& bench, size_t viewpoint)> before_viewpoint;
  std::function<void(SimulatedBench& bench, size_t viewpoint, int pattern)> before_pattern;
  /// Called like CaptureProgress.
  std::function<bool(size_t viewpoint, int pattern)> progress;
};

/// TrialErrors are relative to the ground truth, the middle of the light that an eye sees through a
/// lens. NaN for undefined values.
struct TrialErrors {
  double worst_lenses =
      0.0;  ///< largest error of the phase, over the panel, for every eye of the zone
  double rms_lenses = 0.0;
  double pitch = 0.0;  ///< relative error
  double slant = 0.0;  ///< px/px
  double gap = 0.0;    ///< relative error of the phase's change with the eye
  double map_rms_lenses =
      0.0;  ///< error of the phase's shape, without its line, for the middle eye
  std::vector<double> effective_pitch;  ///< relative error at each viewpoint
  std::vector<double> effective_slant;  ///< px/px
  /// Like worst_lenses, but at each viewpoint alone, with the rig evaluated at the fitted camera
  /// position: the visible unevenness of a picture that should look even there.
  std::vector<double> flat_lenses;
};

struct TrialResult {
  calib::Calibration calibration;
  std::vector<calib::ViewpointMeasurement> measurements;
  std::string failure;  ///< message of the error that ended the trial, empty if none did
  TrialErrors errors;   ///< valid if there is a rig: not after a failure
  TrialErrors single;   ///< errors of a calibration from the first viewpoint alone
  double wall_seconds = 0.0;
  double shown_seconds = 0.0;  ///< time on the simulated clock, longest viewpoint
};

/// Returns the errors of a rig on a bench.
[[nodiscard]] TrialErrors errors_of(const optics::Rig& found, const SimulatedBench& bench,
                                    const Trial& trial);

/// Fills in the errors of result.calibration, which was made on that bench.
void evaluate_trial(const Trial& trial, const SimulatedBench& bench, TrialResult& result);

/// Runs the trial. Errors are returned in `failure`, never thrown.
[[nodiscard]] TrialResult run_trial(const Trial& trial);

/// Returns a 27-inch panel of `width` x `height` pixels.
[[nodiscard]] optics::Panel trial_panel(int width, int height);
/// Returns a trial with the sheet of the sample kiosk rig, a camera of that size and three
/// viewpoints, without faults; the start is 2 % off in pitch.
[[nodiscard]] Trial plain_trial(int panel_width, int panel_height, int camera_width,
                                int camera_height);
/// Returns a random realistic trial: pitch 4 to 40 subpixels, slant -30 to 30 degrees, viewing
/// cones of 8 to 24 degrees, deformation up to 0.15 lens, a start up to 10 % off; 1 to 5 % noise,
/// Bayer sensor, eight bits, usually JPEG, rolling shutter, slow liquid crystal, lens distortion,
/// viewpoints placed by hand.
[[nodiscard]] Trial random_trial(uint64_t seed, int panel_width, int panel_height, int camera_width,
                                 int camera_height);

// Draws random but realistic sheets and cameras, for tests over many of them.

/// Returns a sheet with 4 to 40 subpixels per lens, a slant up to 30 degrees, a viewing cone of 8
/// to 24 degrees, nearly in focus, deformed by up to 0.15 lens.
[[nodiscard]] SimulatedSheet random_sheet(PortableRandom& random, const optics::Panel& panel);

/// Returns an ordinary webcam on a tripod, viewpoint 0 (left), 1 (middle) or 2 (right): about 700
/// mm away and 250 mm to the side, looking roughly at the middle, with the panel over 55 to 80 % of
/// the picture's width. Lens and sensor are random too: for one camera at several viewpoints,
/// random_trial draws only the places of the others.
[[nodiscard]] SimulatedCamera random_camera(PortableRandom& random, const optics::Panel& panel,
                                            int viewpoint);

}  // namespace lenticule::lab
