// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/plane_fit.h"

#include <fmt/format.h>

#include <utility>

#include "base/statistics.h"
#include "calib/photo/fringe_start.h"
#include "calib/photo/sheet_map.h"

namespace lenticule::calib {
namespace {

constexpr double kMostSaturated = 0.5;
constexpr double kLeastCovered = 0.5;
constexpr double kLeastContrast = 0.05;
constexpr double kMostRmsLenses = 0.05;
constexpr double kMostLeftOut = 0.2;

void improve(PlaneFit& fit, const LensPlane& add) {
  LensPlane plane = plane_of(fit.rig);
  plane.at += add.at;
  plane.across += add.across;
  plane.down += add.down;
  fit.rig = with_plane(fit.rig, plane);
}

/// Refines the plane in rounds: relative to a better plane, a block's own fringes are straighter.
void refine_plane(const SinglePhotoChart& chart, PlaneFit& fit) {
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds; ++round) {
    fit.blocks = measure_blocks(fit.fringes, chart, fit.rig);
    fit.correction = fit_plane(fit.blocks);
    improve(fit, fit.correction.add);
  }
}

}  // namespace

double PlaneFit::left_out() const {
  if (blocks.empty()) return 1.0;
  return 1.0 - static_cast<double>(correction.used) / static_cast<double>(blocks.size());
}

Refusal locate_fringes(const PhotoLight& picture, const PhotoPose& pose,
                       const SinglePhotoChart& chart, PlaneFit& fit) {
  fit.fringes = collect_fringes(picture, pose, chart);
  if (fit.fringes.saturated > kMostSaturated)
    return fmt::format("{:.0f} % of the fringes are clipped: expose less",
                       100.0 * fit.fringes.saturated);
  if (fit.fringes.covered < kLeastCovered)
    return fmt::format("only {:.0f} % of the fringes are in the picture",
                       100.0 * fit.fringes.covered);
  const FringeCount count = count_fringes(fit.fringes, chart);
  if (count.prominence < kLeastProminence)
    return "no fringes were found: the picture is blurred, the sheet is not on the panel, or its "
           "pitch differs by more than a tenth from the rig's";
  LensPlane plane = plane_of(chart.start);
  plane.across += count.more_lenses.x;
  plane.down += count.more_lenses.y;
  fit.rig = with_plane(chart.start, plane);
  return std::nullopt;
}

Refusal fit_phases(const SinglePhotoChart& chart, PlaneFit& fit) {
  fit.blocks = measure_blocks(fit.fringes, chart, fit.rig);
  improve(fit, search_plane(fit.blocks));
  refine_plane(chart, fit);
  fit.uneven_lenses = fit.correction.max_lenses;
  // The next map captures the part that the previous map smoothed away.
  constexpr int kMaps = 3;
  for (int map = 0; map < kMaps && fit.correction.max_lenses > kEvenLenses; ++map) {
    fit.rig.sheet.residual =
        sum_of_maps(fit.rig.sheet.residual, smooth_map(fit.blocks, fit.correction.residuals));
    refine_plane(chart, fit);
  }
  if (median_contrast(fit.blocks) < kLeastContrast)
    return "the fringes are too faint: the picture is blurred or the room too bright";
  if (fit.left_out() > kMostLeftOut || fit.blocks.size() < 20 ||
      fit.correction.rms_lenses > kMostRmsLenses)
    return fmt::format(
        "the fringes do not fit an even sheet (rms {:.3f} lenses in {} of {} blocks): the picture "
        "is out of focus, a lamp is reflected, or the sheet came loose",
        fit.correction.rms_lenses, fit.correction.used, fit.blocks.size());
  return std::nullopt;
}

double median_contrast(const std::vector<FringeBlock>& blocks) {
  std::vector<double> values;
  for (const FringeBlock& block : blocks) values.push_back(block.contrast);
  return upper_median(std::move(values));
}

}  // namespace lenticule::calib
