// SPDX-License-Identifier: Apache-2.0
// One place of the camera: everything that is shown to it there, and what comes out before the
// places are put together.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "calib/calibration.h"
#include "calib/measure/capture.h"
#include "calib/measure/fringe_phase.h"
#include "optics/model.h"

namespace lenticule::calib {

struct MeasureOptions {
  std::string name = "centre";
  /// Whether the link and the lens spot are measured too: once per calibration is enough.
  bool link_and_spot = true;
  /// False where patterns cannot depend on what was seen before (photographs): they are those of
  /// photo_patterns(), the fringes have the starting pitch, and aliases cannot be told.
  bool adaptive = true;
};

/// A decoded point for finding where the camera is: block mean of what the wide waves say.
struct GeometryPoint {
  Vec2 camera_px;
  Vec2 panel_px;
  double sigma_px = 0.0;
};

struct ViewpointMeasurement {
  std::string name;
  int width = 0;
  int height = 0;
  Fringe fringe;                    ///< of the fine fringes
  LinearPhase line;                 ///< of green's blocks
  std::array<BlockGrid, 3> blocks;  ///< red, green, blue
  std::vector<GeometryPoint> geometry;
  double contrast = 0.0;                     ///< of green's fringes
  std::array<double, 3> channel_contrast{};  ///< what agrees within blocks; 0 = not measured
  double covered = 0.0;
  double white_light = 0.0;  ///< of the white panel, mean, of full scale; 0 = not measured
  /// Between green's fringes and their repetition at the end: the worst of a plane through the
  /// change.
  double drift_lenses = 0.0;
  /// How far the marks are from where they were at first, camera pixels; one for each photograph,
  /// none where it is a camera that is at hand.
  std::vector<Vec2> mark_moves;
  /// The pictures show the code of the rig that is calibrated. False where they show none.
  bool rig_code_read = false;
  LinkCheck link;
  std::optional<LensSpot> spot;
  std::vector<std::string> warnings;
  CaptureCounts counts;
};

/// Number of patterns of a measurement, for progress; more are shown when the start is an alias.
[[nodiscard]] int pattern_count(const MeasureOptions& options);

/// The patterns of a measurement that is not adaptive, in their order and with their marks: what
/// has to be photographed, one picture each.
[[nodiscard]] std::vector<Pattern> photo_patterns(const optics::Rig& start);

/// Shows everything and measures. The rig of `start` tells panel, nominal pitch, slant and gap.
/// Throws Error(Device) where PatternCapture does, Error(Input) for photographs of patterns that
/// were drawn for another rig, Error(Quality) when nothing usable is seen: the
/// panel's middle is hidden, no fringes, too dark, too little of the panel.
[[nodiscard]] ViewpointMeasurement measure_viewpoint(frames::FrameSink& sink, Camera& camera,
                                                     const optics::OpticalModel& start,
                                                     const CaptureOptions& capture,
                                                     const MeasureOptions& options,
                                                     const CaptureProgress& progress);

}  // namespace lenticule::calib
