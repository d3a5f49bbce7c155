// SPDX-License-Identifier: Apache-2.0
// The optical model: where lenses are, what an eye sees through them, and which ray each subpixel
// sends. docs/optics.md derives the formulas and names each symbol's identifier.
#pragma once

#include <cstdint>
#include <memory>

#include "optics/rig.h"
#include "optics/vec.h"

namespace lenticule::optics {

class ResidualSpline;

/// An eye in the panel frame. For z = infinity (parallel projection) x and y are the tangents of
/// the direction to the eye instead of millimetres.
struct Eye {
  double x = 0.0;
  double y = 0.0;
  double z_mm = 0.0;
};

/// A lens and a place under it: phase = lens + place, place in [-1/2, 1/2), half-open so that each
/// phase belongs to exactly one lens.
struct LensPlace {
  int64_t lens = 0;
  double place = 0.0;
};

/// A phase this little below a border between two lenses counts as on it. At rational pitches whole
/// columns of subpixels lie exactly on borders, and rounding must not scatter them over both
/// lenses. Far above the rounding of a phase (below 2e-11 lens on every panel), far below anything
/// visible.
inline constexpr double kBorderTolerance = 0x1p-32;

/// phase = lens + place within kBorderTolerance.
[[nodiscard]] LensPlace split_phase(double phase);

/// The ray that a subpixel sends through its lens: it leaves the lens-apex plane at
/// (lens_x_mm, lens_y_mm, 0) in direction (tan_x, tan_y, 1) toward the viewing line.
struct SubpixelRay {
  double lens_x_mm = 0.0;
  double lens_y_mm = 0.0;
  double tan_x = 0.0;
  double tan_y = 0.0;
  int64_t lens = 0;  ///< k, the lens that serves a viewer on the viewing line
  double place =
      0.0;  ///< f_E0 in [-1/2, 1/2): position under that lens seen from the line's centre
};

/// One rig, ready to be evaluated. Immutable and cheap to copy; safe from any thread.
/// All arguments are panel points in pixels (X right, Y down) unless a name says otherwise.
class OpticalModel {
 public:
  /// Throws Error(Input) where validate_rig does.
  explicit OpticalModel(const Rig& rig);

  [[nodiscard]] const Rig& rig() const;

  /// lambda_c(X, Y): the lens coordinate above a panel point; apex lines are the integers.
  [[nodiscard]] double lens_coordinate(double x_px, double y_px, int channel) const;

  /// Delta(L, E) in millimetres: the panel point that the eye sees at lens point L is L - Delta.
  [[nodiscard]] Vec2 refraction_shift_mm(Vec2 lens_point_mm, const Eye& eye) const;

  /// The lens point L at which `eye` sees panel point Q, both in millimetres: solves L - Delta = Q.
  [[nodiscard]] Vec2 lens_point_mm(Vec2 panel_point_mm, const Eye& eye) const;

  /// All eyes have z > 0.
  /// Phi_E(Q): the lens coordinate at the lens point through which `eye` sees panel point Q.
  /// The eye sees, through lens k, the subpixels with Phi_E = k.
  [[nodiscard]] double phase(double x_px, double y_px, int channel, const Eye& eye) const;

  /// The subpixel's chief ray for a viewer on the viewing line: lens = round(Phi_E0(Q)), and the
  /// eye (Ex, Ey, Z) that the ray goes to has Phi_E(Q) = lens. lens_x_mm follows the full law;
  /// lens_y_mm is the paraxial one, so that the rays of one row and channel lie in one plane.
  [[nodiscard]] SubpixelRay ray(int i, int j, int channel) const;

  /// How a ray leaves the sheet when its lens's apex line would lie `rest` gaps to the right of the
  /// panel point, seen straight from the front: rest = (k - ideal phase) p_h / g. `tan_y` is the
  /// panel point's, toward the viewing line. Only where the rig has no residual map.
  struct Bend {
    double shift = 0.0;  ///< lens point minus panel point along x, in gaps
    double tan_x = 0.0;
  };
  [[nodiscard]] Bend bend(double rest, double tan_y) const;

  /// The centre of the viewing line, E0 = (0, Ey, Z).
  [[nodiscard]] const Eye& design_eye() const { return design_eye_; }

  /// The residual map as it is evaluated; empty where the rig has none.
  [[nodiscard]] const ResidualSpline& residual() const;

  /// p_h = P a_x / 3: lens pitch along a row, mm.
  [[nodiscard]] double pitch_mm() const;
  /// Width of one viewing lobe at distance z (mm): p_h z / g. Infinite gap-less rigs give infinity.
  [[nodiscard]] double lobe_width_mm(double z_mm) const;
  /// |z| up to which the sheet resolves full detail: p_h / (lobe angle / N), N = subpixels per
  /// lens.
  [[nodiscard]] double depth_of_field_mm() const;

 private:
  struct Prepared;  // the rig and what is computed once from it, shared by copies
  std::shared_ptr<const Prepared> prepared_;
  Eye design_eye_;
};

/// v = views (1/2 - place): view number in (0, views]; a larger one is a viewer further right.
[[nodiscard]] inline double view_number(double place, double views) {
  return views * (0.5 - place);
}

}  // namespace lenticule::optics
