// SPDX-License-Identifier: Apache-2.0
// OpticalModel is the optical model: the positions of the lenses, the subpixels that an eye sees
// through the lenses, and the ray that each subpixel sends. docs/panel/optics.md derives the
// formulas and names each symbol's identifier.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "optics/rig.h"
#include "optics/vec.h"

namespace lenticule::optics {

/// ResidualSpline is a bicubic Catmull-Rom spline through the knots of a ResidualMap. The knots
/// beyond the border extrapolate the last two knots in a straight line, so that the map is linear
/// outside the panel and smooth (C1) everywhere. Immutable.
class ResidualSpline {
 public:
  struct Value {
    double lenses = 0.0;
    double per_px_x = 0.0;  ///< derivative to the right, lenses per pixel
  };

  ResidualSpline() = default;
  ResidualSpline(const ResidualMap& map, int width_px, int height_px);

  [[nodiscard]] bool empty() const { return coefficients_.empty(); }
  /// Returns the value at panel point (X, Y) in pixels, on or off the panel.
  [[nodiscard]] Value at(double x_px, double y_px) const;

  // The functions below serve evaluation of many points at a time. Cell (c, r) covers the grid
  // coordinates [c, c+1) x [r, r+1), c = X knots_per_px_x; c runs from -1 to columns - 1. The 16
  // coefficients of a cell are those of t^q u^p at index 4 p + q, with t, u the coordinates inside
  // the cell.
  [[nodiscard]] const double* coefficients() const { return coefficients_.data(); }
  [[nodiscard]] int columns() const { return columns_; }
  [[nodiscard]] int rows() const { return rows_; }
  [[nodiscard]] double knots_per_px_x() const { return knots_per_px_x_; }
  [[nodiscard]] double knots_per_px_y() const { return knots_per_px_y_; }

 private:
  int columns_ = 0;
  int rows_ = 0;
  double knots_per_px_x_ = 0.0;
  double knots_per_px_y_ = 0.0;
  std::vector<double> coefficients_;
};

class ResidualSpline;

/// Eye is the position of an eye in the panel frame. For z = infinity (parallel projection) x and y
/// are the tangents of the direction to the eye instead of millimetres.
struct Eye {
  double x = 0.0;
  double y = 0.0;
  double z_mm = 0.0;
};

/// LensPlace is a lens and a position under the lens: phase = lens + place. `place` lies in [-1/2,
/// 1/2), half-open so that each phase belongs to exactly one lens.
struct LensPlace {
  int64_t lens = 0;
  double place = 0.0;
};

/// A phase that lies less than this below a border between two lenses counts as on the border. At
/// rational pitches whole columns of subpixels lie exactly on borders, and rounding must not
/// scatter them over both lenses. The tolerance is far above the rounding error of a phase (below
/// 2e-11 lens on every panel) and far below anything visible.
inline constexpr double kBorderTolerance = 0x1p-32;

/// Splits a phase into lens + place, within kBorderTolerance.
[[nodiscard]] LensPlace split_phase(double phase);

/// SubpixelRay is the ray that a subpixel sends through its lens: the ray leaves the lens-apex
/// plane at (lens_x_mm, lens_y_mm, 0) in direction (tan_x, tan_y, 1) toward the viewing line.
struct SubpixelRay {
  double lens_x_mm = 0.0;
  double lens_y_mm = 0.0;
  double tan_x = 0.0;
  double tan_y = 0.0;
  int64_t lens = 0;  ///< k, the lens that serves a viewer on the viewing line
  double place =
      0.0;  ///< f_E0 in [-1/2, 1/2): position under the lens seen from the viewing line's centre
};

/// OpticalModel evaluates one rig. Immutable and cheap to copy. All arguments are panel points in
/// pixels (X right, Y down) unless a name states otherwise. All eyes must have z > 0.
///
/// Thread safety: any thread.
class OpticalModel {
 public:
  /// Throws the Error(Input) of validate_rig().
  explicit OpticalModel(const Rig& rig);

  [[nodiscard]] const Rig& rig() const;

  /// Returns lambda_c(X, Y), the lens coordinate above a panel point; apex lines are the integers.
  [[nodiscard]] double lens_coordinate(double x_px, double y_px, int channel) const;

  /// Returns Delta(L, E) in millimetres: the eye sees panel point L - Delta at lens point L.
  [[nodiscard]] Vec2 refraction_shift_mm(Vec2 lens_point_mm, const Eye& eye) const;

  /// Returns the lens point L at which `eye` sees panel point Q, both in millimetres. Solves
  /// L - Delta = Q.
  [[nodiscard]] Vec2 lens_point_mm(Vec2 panel_point_mm, const Eye& eye) const;

  /// Returns Phi_E(Q), the lens coordinate at the lens point through which `eye` sees panel point
  /// Q. Through lens k the eye sees the subpixels with Phi_E = k. The eye must have z > 0.
  [[nodiscard]] double phase(double x_px, double y_px, int channel, const Eye& eye) const;

  /// Returns the subpixel's chief ray for a viewer on the viewing line: lens = round(Phi_E0(Q)),
  /// and the eye (Ex, Ey, Z) at the end of the ray has Phi_E(Q) = lens. lens_x_mm follows the full
  /// law; lens_y_mm is the paraxial approximation, so that the rays of one row and channel lie in
  /// one plane.
  [[nodiscard]] SubpixelRay ray(int i, int j, int channel) const;

  /// Bend describes how a ray leaves the sheet.
  struct Bend {
    double shift = 0.0;  ///< lens point minus panel point along x, in gaps
    double tan_x = 0.0;
  };
  /// Returns the bend of a ray if the apex line of its lens lies `rest` gaps to the right of the
  /// panel point, seen perpendicular to the panel: rest = (k - ideal phase) p_h / g. `tan_y` is the
  /// tangent from the panel point toward the viewing line. Valid only for rigs without a residual
  /// map.
  [[nodiscard]] Bend bend(double rest, double tan_y) const;

  /// Returns the centre of the viewing line, E0 = (Ex0, Ey, Z); (0, 0, Z) for parallel zones.
  [[nodiscard]] const Eye& design_eye() const { return design_eye_; }

  /// Returns the evaluated residual map; empty if the rig has none.
  [[nodiscard]] const ResidualSpline& residual() const;

  /// Returns p_h = P a_x / 3, the lens pitch along a row in mm.
  [[nodiscard]] double pitch_mm() const;
  /// Returns the width of one viewing lobe at distance z (mm), p_h z / g; infinite for rigs without
  /// a gap.
  [[nodiscard]] double lobe_width_mm(double z_mm) const;
  /// Returns the |z| up to which the sheet resolves full detail: p_h / (lobe angle / N), where N is
  /// the number of subpixels per lens.
  [[nodiscard]] double depth_of_field_mm() const;

 private:
  struct Prepared;  // the rig and values computed once from the rig, shared by copies
  std::shared_ptr<const Prepared> prepared_;
  Eye design_eye_;
};

/// Returns v = views (1/2 - place), the view number in (0, views]; a larger number belongs to a
/// viewer further right.
[[nodiscard]] inline double view_number(double place, double views) {
  return views * (0.5 - place);
}

}  // namespace lenticule::optics
