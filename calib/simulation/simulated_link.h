// SPDX-License-Identifier: Apache-2.0
// SimulatedPanelLink describes the changes of a frame between the player and the light of the
// simulated panel.
#pragma once

#include <optional>

#include "optics/panel.h"

namespace lenticule::calib {

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

}  // namespace lenticule::calib
