// SPDX-License-Identifier: Apache-2.0
// Inputs and results of the fit: parameters as plain arrays, in the order of projection.h.
#pragma once

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "calib/fit/projection.h"
#include "calib/measure/viewpoint.h"
#include "optics/vec.h"

namespace lenticule::calib {

using CameraValues = std::array<double, kCameraCount>;
using OwnCameraValues = std::array<double, kOwnCount>;
using PoseValues = std::array<double, kPoseCount>;
using SheetParameters = std::array<double, kSheetCount>;

/// KnotWeight is the weight of a knot of a residual map at a panel point; the map is linear in its
/// knots.
struct KnotWeight {
  int knot = 0;  ///< row * columns + column
  double weight = 0.0;
};

struct KnotGrid {
  int columns = 0;
  int rows = 0;
  [[nodiscard]] int count() const { return columns * rows; }
};

/// Returns the weights of the at most 16 knots with which optics::ResidualSpline evaluates panel
/// point (x, y), in pixels, of a panel of that size.
[[nodiscard]] std::vector<KnotWeight> knot_weights(const KnotGrid& grid, Vec2 panel_px,
                                                   int width_px, int height_px);

/// PhaseObservation is one block's fringe phase: theta / 2 pi = s / pitch - Phi (mod 1).
struct PhaseObservation {
  Vec2 camera_px;
  double turns = 0.0;
  double sigma = 0.0;  ///< lenses
};

struct View {
  std::string name;
  Fringe fringe;
  int picture_width = 0;
  int picture_height = 0;
  std::vector<GeometryPoint> geometry;
  std::vector<PhaseObservation> phases;  ///< green's phases

  [[nodiscard]] double longer_px() const { return std::max(picture_width, picture_height); }
};

/// SheetStart is the starting point: the values of the rig file, which are held if the views do not
/// determine them.
struct SheetStart {
  SheetParameters values{};
  double gap_tolerance = 0.5;     ///< relative standard deviation of the prior of the gap
  double shape_tolerance = 0.15;  ///< standard deviation of the prior of the refraction shape
};

/// CameraSameness says whether the camera may differ from view to view.
enum class CameraSameness {
  Same,    ///< one focal length and principal point
  Nearly,  ///< each view's own, within the breathing of a lens and the range of a stabiliser
};

struct PoseFit {
  CameraValues camera{};
  std::vector<OwnCameraValues> own;  ///< zero for CameraSameness::Same
  std::vector<PoseValues> poses;
  double rms_px = 0.0;  ///< panel pixels, per coordinate
};

struct FitValues {
  CameraValues camera{};
  std::vector<OwnCameraValues> own;  ///< one for each view; zero if all views have the same camera
  std::vector<PoseValues> poses;
  SheetParameters sheet{};
  std::vector<double> knots;  ///< knots of the residual map
};

[[nodiscard]] SheetStart sheet_start(const optics::Rig& rig);
/// Writes pitch, slant, offset, gap, shape and residual map into a sheet.
void set_sheet(const SheetParameters& values, const KnotGrid& grid,
               const std::vector<double>& knots, const optics::Panel& panel,
               optics::LensSheet& sheet);

/// Returns the camera with which a view was taken.
[[nodiscard]] CameraValues camera_of(const CameraValues& common, const OwnCameraValues& own,
                                     const View& view);

[[nodiscard]] View view_of(const ViewpointMeasurement& measured, const optics::Panel& panel);

}  // namespace lenticule::calib
