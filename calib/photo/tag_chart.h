// SPDX-License-Identifier: Apache-2.0
// The chart for calibrating with a single photograph: fringes with tags among them that say where
// on the panel they are.
#pragma once

#include <array>
#include <vector>

#include "frames/frame.h"
#include "optics/rig.h"
#include "optics/vec.h"

namespace lenticule::calib {

/// A tag on the panel: a square with its white rim.
struct ChartTag {
  int id = 0;
  double left_px = 0.0;
  double top_px = 0.0;
  double cell_px = 0.0;

  /// Corners of the tag proper, inside its white rim: left bottom, right bottom, right top, left
  /// top, in panel pixels (X, Y down).
  [[nodiscard]] std::array<Vec2, 4> corners_px() const;
  /// Whether a panel point is on the tag, its rim, or within `margin_px` around.
  [[nodiscard]] bool covers(Vec2 panel_px, double margin_px) const;
};

/// A square that a graphics card or a panel that scales shows darker than a flat one: squares of
/// one pixel, lit and dark in turn, beside grey of the same light.
struct ScalePatch {
  double left_px = 0.0;
  double top_px = 0.0;
  double side_px = 0.0;  ///< of each half
  [[nodiscard]] bool covers(Vec2 panel_px, double margin_px) const;
  /// Well inside one half: 0 = grey, 1 = squares; -1 elsewhere.
  [[nodiscard]] int half_at(Vec2 panel_px) const;
};

/// What was shown. Light 1/2 + A/2 cos(2 pi s (1/P_c + d F/(3 W))), s = 3 (X - W/2 + m0 (Y - H/2)):
/// a comb of nearly the lens pitch, of which the sheet shows F slow fringes. d is +1 and -1 in
/// turns from band to band of rows: a place mistaken by some pixels shifts the fringes of
/// neighbouring bands in opposite directions, an error of the pitch in the same direction. So the
/// two are told apart, and the tags need not be found to hundredths of a pixel. In two bands d is
/// +2 and -2: a start that is so far off that one band shows no fringes, or those of the other
/// sign, is told from a good one by the others.
struct SinglePhotoChart {
  optics::Rig start;                ///< what the pitch, slant and offset were before
  double centre_pitch_subpx = 0.0;  ///< P_c: the effective pitch expected at the eye
  int fringes = 0;                  ///< F, across the panel
  int bands = 0;                    ///< of equal height
  double contrast = 0.9;            ///< A
  /// Three rows of three from the top left. Their ids follow from the starting rig, so that a
  /// photograph of another rig's chart is noticed.
  std::vector<ChartTag> tags;
  std::vector<ScalePatch> patches;

  /// The tag with this id, or null.
  [[nodiscard]] const ChartTag* tag(int id) const;
  /// Band of a row: 0 to bands - 1.
  [[nodiscard]] int band_at(double y_px) const;
  /// d of a band.
  [[nodiscard]] static double detuning(int band) {
    return kDetunings[static_cast<size_t>(band) % kDetunings.size()];
  }
  static constexpr std::array<double, 8> kDetunings = {1, -1, 2, -1, 1, -2, 1, -1};
  /// Phase of the comb at a panel point, cycles.
  [[nodiscard]] double comb_phase(double x_px, double y_px, double detuning) const;
};

/// The chart for an eye at the rig's viewing distance (700 mm where that is infinite). Fringes: 3 %
/// of the lenses in a row, 24 to 60. Throws Error(Input) for an invalid rig and for a panel too
/// small for the tags: a tag's cell is 12 lens pitches and 20 pixels at least.
[[nodiscard]] SinglePhotoChart plan_single_photo_chart(const optics::Rig& start);

/// The chart's frame, of the panel's size; sRGB codes of linear light.
[[nodiscard]] frames::WovenFrame draw_single_photo_chart(const SinglePhotoChart& chart);

}  // namespace lenticule::calib
