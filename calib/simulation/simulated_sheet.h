// SPDX-License-Identifier: Apache-2.0
// SimulatedSheet describes the lens sheet of the simulated bench, including the deviations of a
// real sheet from a perfect grating.
#pragma once

#include <array>
#include <cstdint>

#include "optics/panel.h"

namespace lenticule::calib {

/// SimulatedSheet is a sheet of cylinder lenses over a panel. Panel frame as in optics/panel.h:
/// millimetres, origin at the panel's centre on the plane of the apices.
struct SimulatedSheet {
  double pitch_subpx = 7.7;    ///< measured along a pixel row, in thirds of a pixel
  double slant = 0.0;          ///< an apex line moves LEFT by this many pixels per row down
  double offset_lenses = 0.0;  ///< lens coordinate at the panel's centre; apex lines are integers

  double radius_mm = 1.1;     ///< radius of the cylinders
  double thickness_mm = 3.3;  ///< distance from the apices to the other, flat face of the sheet
  std::array<double, 3> index{1.50, 1.50,
                              1.50};  ///< refractive index for red, green and blue light
  double air_gap_mm = 0.0;            ///< gap between the sheet and the plane of the pixels
  /// The apices face the panel: the light crosses the air gap, a lens, and then the flat slab.
  bool lens_toward_panel = false;

  /// Largest deviation of the lens coordinate from a perfect grating: a smooth random field without
  /// constant and linear part, so that pitch, slant and offset keep their meaning.
  double deformation_lenses = 0.0;
  /// Relative extra thickness of the stack in the middle compared with the corners; the mean stays.
  double gap_bow = 0.0;
  double curve_radius_mm =
      0.0;  ///< radius of a panel bent around a vertical axis toward the viewer; 0 = flat
  double black_matrix = 0.25;  ///< dark fraction of the area of each subpixel
  double haze = 0.0;           ///< fraction of the light that is scattered over the neighbourhood
  double bubbles = 0.0;        ///< fraction of the panel where the light is scrambled
  int scratches = 0;           ///< straight lines, a millimetre wide, that scramble light too
  uint64_t seed = 1;           ///< seed of the deformation, the bubbles and the scratches
};

/// LightMiddle defines the middle of the light of a lens. The two definitions differ where
/// aberrations make the spot asymmetric: over 200 random sheets by up to 0.004 lens for an eye in
/// front of the middle of a 27-inch panel 700 mm away, by up to 0.05 lens at the far edge for an
/// eye 250 mm to the side.
enum class LightMiddle {
  Centroid,     ///< the mean of the rays' landing points
  FringePhase,  ///< the phase of fringes as wide as the lens, which phase stepping can measure
};

/// ChiefRay holds gap and refraction shape of the chief ray, the expected calibration result for
/// thin lenses. g = t/n (+ air gap), nu = D3/D1 with D1 = sum t/n, D3 = sum t/n^3.
struct ChiefRay {
  double gap_mm = 0.0;
  double refraction_shape = 1.0;
};
[[nodiscard]] ChiefRay chief_ray(const SimulatedSheet& sheet, int channel);

/// Throws Error(Input) for an impossible sheet (non-finite, lenses wider than their cylinders, an
/// index below 1, zero thickness) and for an impossible panel.
void check_sheet(const SimulatedSheet& sheet, const optics::Panel& panel);

}  // namespace lenticule::calib
