// SPDX-License-Identifier: Apache-2.0
#include "calib/fit/observations.h"

#include <algorithm>

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

void put_sheet(const SheetParameters& values, const KnotGrid& grid,
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

}  // namespace lenticule::calib
