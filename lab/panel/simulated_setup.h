// SPDX-License-Identifier: Apache-2.0
// The parts of the simulated bench as their makers and owners would describe them: sheet, link from
// the player to the panel, camera.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "optics/panel.h"
#include "optics/vec.h"

namespace lenticule::lab {

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
  double gap_mm = 0.0;                ///< distance from the sheet to the plane of the pixels
  double gap_index = 1.0;  ///< refractive index of the gap: air; glass and polariser have some 1.52
  /// The apices face the panel: the light crosses the gap, a lens, and then the flat slab.
  bool lens_toward_panel = false;
  double valley = 0.0;  ///< fraction of the pitch, around the borders of lenses, that only scatters

  /// Largest deviation of the lens coordinate from a perfect grating: a smooth random field without
  /// constant and linear part, so that pitch, slant and offset keep their meaning.
  double deformation_lenses = 0.0;
  /// Amplitudes of a deformation that need not keep that meaning, lenses: x^2, xy, y^2, x^3, y^3
  /// and sin(2 pi x) cos(pi y); x and y from -1 to 1 over the panel, right and up.
  std::array<double, 6> bend_lenses{};
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
/// thin lenses. g = D1, nu = D3/D1 with D1 = sum t/n, D3 = sum t/n^3 over sheet and gap.
struct ChiefRay {
  double gap_mm = 0.0;
  double refraction_shape = 1.0;
};
[[nodiscard]] ChiefRay chief_ray(const SimulatedSheet& sheet, int channel);

/// Throws Error(Input) for an impossible sheet (non-finite, lenses wider than their cylinders, an
/// index below 1, zero thickness) and for an impossible panel.
void check_sheet(const SimulatedSheet& sheet, const optics::Panel& panel);

// SimulatedPanelLink describes the changes of a frame between the player and the light of the
// simulated panel.

enum class Chroma {
  Full,       ///< 4:4:4
  HalfWidth,  ///< 4:2:2: two pixels of a row share their chroma
  HalfBoth,   ///< 4:2:0: two by two pixels share it
};

struct SimulatedPanelLink {
  Chroma chroma = Chroma::Full;
  /// The true positions of the subpixels, which may differ from the player's assumption; empty = as
  /// assumed.
  std::optional<optics::SubpixelLayout> actual_layout;
  double eotf_exponent = 0.0;  ///< light = code^exponent; 0 = the sRGB curve
  double refresh_hz = 60.0;
  double response_ms = 0.0;  ///< time constant of the liquid crystal
  double scan_out_ms = 0.0;  ///< delay from the first to the last row of a new frame
  double pwm_hz = 0.0;       ///< frequency of the backlight; 0 = steady
  double pwm_duty = 0.5;     ///< lit part of a PWM period; the mean light stays the same
  /// A white logo that the panel overlays on every frame: a rectangle, relative to the panel's
  /// width and height. Width 0: no logo.
  double logo_left = 0.0;
  double logo_top = 0.0;
  double logo_width = 0.0;
  double logo_height = 0.0;
};

/// Throws Error(Input) for an impossible link.
void check_link(const SimulatedPanelLink& link);

// SimulatedCamera describes the camera of the simulated bench: its position, lens, sensor and
// faults.

enum class CameraCurve { Linear, Srgb, Gamma };

/// Picture coordinates are pixels, (0, 0) the outer corner of the top-left pixel: the centre of
/// pixel (column, row) is (column + 1/2, row + 1/2).
struct SimulatedCamera {
  int width = 1920;
  int height = 1080;
  double focal_px = 1500.0;
  double centre_x_px = 960.0;
  double centre_y_px = 540.0;
  double k1 = 0.0;  ///< x_distorted = x (1 + k1 r^2 + k2 r^4), r of the undistorted tangents
  double k2 = 0.0;
  Vec3 position_mm{0, 0, 700};  ///< position of the pupil, panel frame
  Vec3 look_at_mm{0, 0, 0};
  double roll_degrees =
      0.0;  ///< rotation around the camera's axis, clockwise seen from behind the camera
  double pupil_mm = 2.0;      ///< diameter; the camera is focused on the sheet
  double psf_sigma_px = 0.6;  ///< blur, added to the pixel's own square

  int samples = 12;   ///< rays per pixel, 1 to 255
  bool bayer = true;  ///< RGGB, three channels; otherwise one channel that sees all colours
  /// response[camera colour][display colour]; a one-channel camera has their sum.
  std::array<std::array<double, 3>, 3> response{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

  double white_light = 0.7;   ///< light of the middle of a white panel, relative to full scale
  double ambient = 0.005;     ///< ambient light, relative to full scale
  bool vignetting = true;     ///< cos^4 of the angle to the axis
  double read_noise = 0.005;  ///< standard deviation of dark pixels, relative to full scale
  double shot_noise = 0.005;  ///< added at full scale; grows with the root of the light

  CameraCurve curve = CameraCurve::Srgb;
  double gamma = 2.2;  ///< code = light^(1/gamma), for CameraCurve::Gamma
  /// The curve that the program assumes and inverts.
  CameraCurve assumed_curve = CameraCurve::Srgb;
  bool eight_bits = true;  ///< otherwise the codes are not rounded
  int jpeg_quality = 0;    ///< 1 to 100, 4:2:0; 0 = uncompressed

  double frames_per_second = 30.0;
  double exposure_ms = 16.667;
  double rolling_shutter_ms = 0.0;  ///< delay from the first to the last row
  double gain_drift = 0.0;          ///< standard deviation of the gain from picture to picture
  double row_banding = 0.0;         ///< amplitude of gain waves down the rows
  double shake_mm = 0.0;  ///< standard deviation of the position from shown frame to shown frame

  /// A reflection that saturates: an ellipse, centre and half axes relative to the picture's width
  /// and height. Half axes of 0: no reflection.
  double highlight_x = 0.55;
  double highlight_y = 0.45;
  double highlight_half_width = 0.0;
  double highlight_half_height = 0.0;
};

/// Throws Error(Input) for an impossible camera.
void check_camera(const SimulatedCamera& camera);
}  // namespace lenticule::lab
