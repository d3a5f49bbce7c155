// SPDX-License-Identifier: Apache-2.0
// Measures one camera position (viewpoint): shows all patterns and computes the results that need
// no other viewpoint.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/calibration.h"
#include "calib/measure/capture.h"
#include "calib/measure/fringe_phase.h"
#include "calib/measure/pattern.h"
#include "optics/model.h"
#include "optics/rig.h"

namespace lenticule::calib {

// Checks that the link transmits every subpixel, and measures the camera's response to the panel's
// colours.

/// Mean light of the camera's channels over the panel, without ambient light.
using MeanColour = std::array<double, 3>;

/// Returns the mean light of pixels, without that of the dark panel.
[[nodiscard]] MeanColour mean_colour(const CameraPicture& picture, const CameraPicture& dark,
                                     const std::vector<uint32_t>& pixels);

struct LinkPictures {
  int camera_channels = 0;
  MeanColour white{};
  std::array<MeanColour, 3> flat{};     ///< the panel's red, green and blue, each alone
  std::array<MeanColour, 3> columns{};  ///< the same colours, every other column of pixels dark
  MeanColour checks{};                  ///< squares of one pixel
};

/// Returns the channel weights with which the camera sees one colour of the panel best:
/// proportional to the channels' response to the colour.
[[nodiscard]] ChannelWeights weights_for(const LinkPictures& pictures, int panel_channel);

/// Computes chroma_subsampled, scaled, chroma_leak and their findings.
[[nodiscard]] LinkCheck check_link(const LinkPictures& pictures);

struct MeasureOptions {
  std::string name = "centre";
  /// True if the link and the lens spot are measured too; once per calibration is enough.
  bool link_and_spot = true;
  /// False if patterns cannot depend on earlier pictures (photographs): the patterns are those of
  /// photo_patterns(), the fringes have the starting pitch, and aliases cannot be detected.
  bool adaptive = true;
};

/// Returns the number of patterns of a measurement, for progress; a start that is an alias needs
/// more.
[[nodiscard]] int pattern_count(const MeasureOptions& options);

/// Returns the patterns of a measurement that is not adaptive, in their order and with their marks:
/// the patterns to be photographed, one picture each.
[[nodiscard]] std::vector<Pattern> photo_patterns(const optics::Rig& start);

/// GeometryPoint is a decoded point for locating the camera: the block mean of the wide waves'
/// positions.
struct GeometryPoint {
  Vec2 camera_px;
  Vec2 panel_px;
  double sigma_px = 0.0;
};

struct ViewpointMeasurement {
  std::string name;
  int width = 0;
  int height = 0;
  Fringe fringe;                    ///< the fine fringes
  LinearPhase line;                 ///< line through green's blocks
  std::array<BlockGrid, 3> blocks;  ///< red, green, blue
  std::vector<GeometryPoint> geometry;
  double contrast = 0.0;                     ///< contrast of green's fringes
  std::array<double, 3> channel_contrast{};  ///< agreement within blocks; 0 = not measured
  double covered = 0.0;
  double white_light =
      0.0;  ///< mean light of the white panel, relative to full scale; 0 = not measured
  /// Phase change between green's fringes and their repetition at the end: the largest value of a
  /// plane fitted to the change.
  double drift_lenses = 0.0;
  /// Movement of the marks since the first picture, camera pixels; one for each photograph, empty
  /// for a live camera.
  std::vector<Vec2> mark_moves;
  /// True if the pictures show the code of the calibrated rig; false if they show no code.
  bool rig_code_read = false;
  std::vector<uint64_t> doubles;  ///< PatternCapture::doubles
  LinkCheck link;
  std::optional<LensSpot> spot;
  std::vector<std::string> warnings;
  CaptureCounts counts;
};

/// Shows all patterns and measures. The rig of `start` gives panel, nominal pitch, slant and gap.
/// Throws the Error(Device) of PatternCapture, Error(Input) for photographs of patterns drawn for
/// another rig, Error(Quality) for unusable pictures: the panel's middle is hidden, no fringes, too
/// dark, too little of the panel.
[[nodiscard]] ViewpointMeasurement measure_viewpoint(frames::FrameSink& sink, Camera& camera,
                                                     const optics::OpticalModel& start,
                                                     const CaptureOptions& capture,
                                                     const MeasureOptions& options,
                                                     const CaptureProgress& progress);

}  // namespace lenticule::calib
