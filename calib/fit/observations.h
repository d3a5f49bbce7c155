// SPDX-License-Identifier: Apache-2.0
// Inputs and results of the fit: parameters as plain arrays, in the order of projection.h.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
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

/// Lower limit of a block's standard error: the errors of the model are larger.
inline constexpr double kLeastSigma = 5e-4;

[[nodiscard]] inline SheetStart sheet_start(const optics::Rig& rig) {
  const optics::LensSheet& sheet = rig.sheet;
  SheetStart start;
  start.values[kAcross] = 1.5 * rig.panel.width_px / sheet.pitch.value;
  start.values[kDown] = 1.5 * sheet.slant * rig.panel.height_px / sheet.pitch.value;
  start.values[kOffset] = sheet.offset.value;
  start.values[kGap] = sheet.gap.value;
  start.values[kShape] = sheet.refraction_shape;
  return start;
}

/// Writes pitch, slant, offset, gap, shape and residual map into a sheet.
inline void set_sheet(const SheetParameters& values, const KnotGrid& grid,
                      const std::vector<double>& knots, const optics::Panel& panel,
                      optics::LensSheet& sheet) {
  sheet.pitch = Subpixels(1.5 * panel.width_px / values[kAcross]);
  sheet.slant = values[kDown] / values[kAcross] * panel.width_px / panel.height_px;
  sheet.offset = Lenses(values[kOffset] - std::floor(values[kOffset] + 0.5));
  sheet.gap = Millimetres(values[kGap]);
  sheet.refraction_shape = values[kShape];
  sheet.residual = {.columns = grid.columns, .rows = grid.rows, .lenses = knots};
  if (grid.count() == 0) sheet.residual = {};
}

/// Returns the camera with which a view was taken.
[[nodiscard]] inline CameraValues camera_of(const CameraValues& common, const OwnCameraValues& own,
                                            const View& view) {
  CameraValues out{};
  camera_of_view(common.data(), own.data(), view.longer_px(), out.data());
  return out;
}

[[nodiscard]] inline View view_of(const ViewpointMeasurement& measured,
                                  const optics::Panel& panel) {
  View view{.name = measured.name,
            .fringe = measured.fringe,
            .picture_width = measured.width,
            .picture_height = measured.height,
            .geometry = measured.geometry,
            .phases = {}};
  for (const PhaseBlock& block : measured.blocks[1].blocks) {
    if (block.pixels == 0) continue;
    const double s = 3.0 * ((block.panel_px.x - panel.width_px / 2.0) +
                            view.fringe.slant * (block.panel_px.y - panel.height_px / 2.0));
    view.phases.push_back({.camera_px = block.camera_px,
                           .turns = s / view.fringe.pitch_subpx - block.phase,
                           .sigma = std::max(block.sigma, kLeastSigma)});
  }
  return view;
}

using Line = std::vector<KnotWeight>;

inline void add(Line& line, int knot, double weight) {
  for (KnotWeight& known : line)
    if (known.knot == knot) {
      known.weight += weight;
      return;
    }
  line.push_back({knot, weight});
}

/// Adds the weight of a knot; a knot beyond the border extrapolates the last two in a straight
/// line.
inline void add_extended(Line& line, int knot, int count, double weight) {
  const int last = count - 1;
  if (knot >= 0 && knot <= last) return add(line, knot, weight);
  if (last == 0) return add(line, 0, weight);
  const int edge = knot < 0 ? 0 : last;
  const int inner = knot < 0 ? 1 : last - 1;
  const double beyond = knot < 0 ? -knot : knot - last;
  add(line, edge, weight * (1.0 + beyond));
  add(line, inner, -weight * beyond);
}

/// Returns the Catmull-Rom weights of a line of knots at grid coordinate `at`.
inline Line line_weights(double at, int count) {
  const double cell = std::clamp(std::floor(at), -1.0, count - 1.0);
  const double t = at - cell;
  const std::array<double, 4> weights = {t * (-0.5 + t * (1.0 - 0.5 * t)),
                                         1.0 + t * t * (-2.5 + 1.5 * t),
                                         t * (0.5 + t * (2.0 - 1.5 * t)), t * t * (-0.5 + 0.5 * t)};
  Line line;
  for (int k = 0; k < 4; ++k)
    add_extended(line, static_cast<int>(cell) + k - 1, count, weights[static_cast<size_t>(k)]);
  return line;
}

/// Returns the weights of the at most 16 knots with which optics::ResidualSpline evaluates panel
/// point (x, y), in pixels, of a panel of that size.
[[nodiscard]] inline std::vector<KnotWeight> knot_weights(const KnotGrid& grid, Vec2 panel_px,
                                                          int width_px, int height_px) {
  const Line across = line_weights(panel_px.x * (grid.columns - 1.0) / width_px, grid.columns);
  const Line down = line_weights(panel_px.y * (grid.rows - 1.0) / height_px, grid.rows);
  std::vector<KnotWeight> weights;
  for (const KnotWeight& y : down)
    for (const KnotWeight& x : across)
      weights.push_back({y.knot * grid.columns + x.knot, x.weight * y.weight});
  return weights;
}

}  // namespace lenticule::calib
