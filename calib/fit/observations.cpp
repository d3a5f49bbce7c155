// SPDX-License-Identifier: Apache-2.0
#include "calib/fit/observations.h"

#include <cmath>

namespace lenticule::calib {
namespace {

/// Lower limit of a block's standard error: the errors of the model are larger.
constexpr double kLeastSigma = 5e-4;

}  // namespace

SheetStart sheet_start(const optics::Rig& rig) {
  const optics::LensSheet& sheet = rig.sheet;
  SheetStart start;
  start.values[kAcross] = 1.5 * rig.panel.width_px / sheet.pitch.value;
  start.values[kDown] = 1.5 * sheet.slant * rig.panel.height_px / sheet.pitch.value;
  start.values[kOffset] = sheet.offset.value;
  start.values[kGap] = sheet.gap.value;
  start.values[kShape] = sheet.refraction_shape;
  return start;
}

void set_sheet(const SheetParameters& values, const KnotGrid& grid,
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

CameraValues camera_of(const CameraValues& common, const OwnCameraValues& own, const View& view) {
  CameraValues out{};
  camera_of_view(common.data(), own.data(), view.longer_px(), out.data());
  return out;
}

View view_of(const ViewpointMeasurement& measured, const optics::Panel& panel) {
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

namespace {

using Line = std::vector<KnotWeight>;

void add(Line& line, int knot, double weight) {
  for (KnotWeight& known : line)
    if (known.knot == knot) {
      known.weight += weight;
      return;
    }
  line.push_back({knot, weight});
}

/// Adds the weight of a knot; a knot beyond the border extrapolates the last two in a straight
/// line.
void add_extended(Line& line, int knot, int count, double weight) {
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
Line line_weights(double at, int count) {
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

}  // namespace

std::vector<KnotWeight> knot_weights(const KnotGrid& grid, Vec2 panel_px, int width_px,
                                     int height_px) {
  const Line across = line_weights(panel_px.x * (grid.columns - 1.0) / width_px, grid.columns);
  const Line down = line_weights(panel_px.y * (grid.rows - 1.0) / height_px, grid.rows);
  std::vector<KnotWeight> weights;
  for (const KnotWeight& y : down)
    for (const KnotWeight& x : across)
      weights.push_back({y.knot * grid.columns + x.knot, x.weight * y.weight});
  return weights;
}

}  // namespace lenticule::calib
