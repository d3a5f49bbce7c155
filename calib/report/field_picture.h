// SPDX-License-Identifier: Apache-2.0
// Draws small pictures for reports as inline SVG: fields over the panel and a lens's spot.
#pragma once

#include <string>

#include "calib/calibration.h"
#include "optics/rig.h"

namespace lenticule::calib {

/// Returns "#rrggbb" for a value in [-1, 1]: blue over white to brown, which differ in darkness for
/// colour-blind readers and in grey prints. NaN is grey; values outside get the colour of the end.
[[nodiscard]] std::string signed_colour(double share);

/// Returns the largest finite magnitude; 0 if there is none.
[[nodiscard]] double largest_magnitude(const PanelField& field);

/// Returns at most 64 by 36 cells: a finer field is averaged, ignoring cells without a measurement.
/// A field whose size does not match its values becomes empty.
[[nodiscard]] PanelField coarser(const PanelField& field);

/// Draws one rectangle per cell of coarser(field) with the panel's `height_over_width`, full colour
/// at `full_scale`. `what` is the picture's name for people who cannot see it.
[[nodiscard]] std::string field_svg(const PanelField& field, double height_over_width,
                                    double full_scale, const std::string& what);

/// Draws the colours from -full_scale to full_scale with numbers beside them, in `unit`.
[[nodiscard]] std::string colour_bar_svg(double full_scale, const std::string& unit);

/// Draws the light over the place under the lens, as bars.
[[nodiscard]] std::string spot_svg(const LensSpot& spot);

/// Returns the rig's residual map at the middles of cells.
[[nodiscard]] PanelField field_of(const optics::ResidualMap& map);

}  // namespace lenticule::calib
