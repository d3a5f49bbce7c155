// SPDX-License-Identifier: Apache-2.0
// What the fit is made of, and what comes out: parameters as plain arrays, in projection.h's order.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "calib/fit/knot_weights.h"
#include "calib/fit/projection.h"
#include "calib/measure/viewpoint.h"

namespace lenticule::calib {

using CameraValues = std::array<double, kCameraCount>;
using PoseValues = std::array<double, kPoseCount>;
using SheetParameters = std::array<double, kSheetCount>;

/// One block's phase: what the fringes show there, theta / 2 pi = s / pitch - Phi (mod 1).
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
  std::vector<PhaseObservation> phases;  ///< of green
};

/// The starting point: what the rig file says, and what is held when it cannot be told.
struct SheetStart {
  SheetParameters values{};
  double gap_tolerance = 0.5;     ///< relative standard deviation of the gap believed in
  double shape_tolerance = 0.15;  ///< standard deviation of the refraction shape believed in
};

struct FitValues {
  CameraValues camera{};
  std::vector<PoseValues> poses;
  SheetParameters sheet{};
  std::vector<double> knots;  ///< of the residual map
};

[[nodiscard]] SheetStart sheet_start(const optics::Rig& rig);
/// Writes pitch, slant, offset, gap, shape and residual map into a sheet.
void put_sheet(const SheetParameters& values, const KnotGrid& grid,
               const std::vector<double>& knots, const optics::Panel& panel,
               optics::LensSheet& sheet);

[[nodiscard]] View view_of(const ViewpointMeasurement& measured, const optics::Panel& panel);

}  // namespace lenticule::calib
