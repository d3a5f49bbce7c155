// SPDX-License-Identifier: Apache-2.0
// LensSection traces rays through a lens sheet in cross-section: arcs, sheet, glass. It is the
// ground truth of the simulated phone photographs, and shares no formula with the calibration: the
// position that an eye sees results from Snell's law at the arc, not from a fitted law.
//
// Units: millimetres. Panel frame: x right, y up, z toward the viewer, origin at the panel's centre
// on the plane of the lens apices.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "optics/panel.h"
#include "optics/vec.h"

namespace lenticule::lab {

/// SheetBuild describes a lens sheet on a panel by what a workshop could measure.
struct SheetBuild {
  double pitch_subpx = 7.7;  ///< along a pixel row, subpixels
  double slant = 0.25;       ///< apex lines move left by this many pixels per row down
  double offset_lenses = 0.0;
  double sheet_mm = 2.2;      ///< thickness from the apices to the sheet's back
  double glass_mm = 0.5;      ///< glass and polariser between sheet and pixels
  double sheet_index = 1.49;  ///< refractive index at 546 nm
  double abbe = 57.0;         ///< Abbe number of the sheet: acrylic 57, PETG 35
  double glass_index = 1.52;
  double defocus = 0.05;      ///< distance of the pixels beyond the paraxial focus, relative
  double valley = 0.06;       ///< fraction of the pitch, around the borders, that only scatters
  double haze = 0.04;         ///< fraction of the light that comes from anywhere near
  double matrix_x = 0.04;     ///< opaque part of a pixel at each side of a subpixel, pixels
  double matrix_y = 0.08;     ///< the same above and below
  double filter_leak = 0.03;  ///< transmission of a colour filter for another channel
  /// Amplitudes of the deformation, lenses: terms of the lens coordinate that are no plane, in
  /// order x^2, xy, y^2, x^3, y^3, sin(2 pi x) cos(pi y); x and y from -1 to 1 over the panel.
  std::array<double, 6> deformation{};
};

/// LensSection evaluates one build on one panel.
///
/// Thread safety: any thread.
class LensSection {
 public:
  LensSection(const SheetBuild& build, const optics::Panel& panel);

  /// Shift is the way from the point where a ray would cross the plane of the apices to the point
  /// of the pixels that it reaches: across the lenses (toward growing lens coordinates) and along.
  struct Shift {
    double across = 0.0;
    double along = 0.0;
    int lens = 0;  ///< 0, or the neighbour that a ray from the side enters
  };
  /// Traces the ray that crosses the plane of the apices at `place` pitches from an apex and goes
  /// on to an eye in the direction (across, along, 1). Returns nothing if it hits a valley.
  [[nodiscard]] std::optional<Shift> trace(double place, double tan_across, double tan_along,
                                           int channel) const;

  /// Returns the mean shift of the light that goes through one lens to the eye, from the point
  /// where a ray through the apex crosses its plane.
  [[nodiscard]] Shift mean_shift(double tan_across, double tan_along, int channel) const;

  /// Returns the lens coordinate of a point of the plane of the apices, with the deformation.
  [[nodiscard]] double lens_coordinate(Vec2 at_mm) const;

  /// Returns the lens coordinate of the lens, continued between apices, through which the eye sees
  /// a panel point: the middle of the light that reaches the eye through this lens, over its whole
  /// visible width, lies on the point.
  [[nodiscard]] double ground_truth_phase(Vec2 panel_mm, int channel, const Vec3& eye_mm) const;

  [[nodiscard]] const SheetBuild& build() const { return build_; }
  [[nodiscard]] const optics::Panel& panel() const { return panel_; }
  [[nodiscard]] double pitch_mm() const { return pitch_mm_; }  ///< across the lenses
  [[nodiscard]] Vec2 across() const { return across_; }        ///< unit vector
  [[nodiscard]] Vec2 along() const { return {-across_.y, across_.x}; }

 private:
  SheetBuild build_;
  optics::Panel panel_;
  Vec2 across_;
  double pitch_mm_ = 0.0;
  double radius_mm_ = 0.0;
  std::array<double, 3> index_{};
};

// ShiftTable keeps where rays through a lens arrive, so that not every sample of a photograph needs
// a ray of its own through the lens sheet.

/// ShiftTable holds, for directions in steps, where rays of all places under a lens arrive relative
/// to the ray through the apex. A valley has a NaN.
///
/// Thread safety: one thread, because tables are traced when they are first used. Lifetime: must
/// not outlive the sheet.
class ShiftTable {
 public:
  static constexpr int kPlaces = 256;  ///< number of places under a lens

  /// Shift between two points of the pixels, in panel pixels.
  struct Offset {
    float x = 0.0F, y = 0.0F;
  };
  using Table = std::array<Offset, kPlaces>;

  explicit ShiftTable(const LensSection& sheet);

  /// Interpolates the table of a direction.
  void evaluate(double tan_across, double tan_along, int channel, Table& out);

 private:
  static constexpr int kSteps = 120;
  static constexpr double kStep = 0.02;

  const Table& table(int i, int j, int channel);
  [[nodiscard]] Table trace(double tan_across, double tan_along, int channel) const;

  const LensSection& sheet_;
  std::vector<std::optional<Table>> values_;
};
}  // namespace lenticule::lab
