// SPDX-License-Identifier: Apache-2.0
// Small pictures for reports, as inline SVG: fields over the panel and a lens's spot.
#pragma once

#include <string>

#include "calib/calibration.h"
#include "optics/rig.h"

namespace lenticule::calib {

/// "#rrggbb" of a share in [-1, 1]: blue over white to brown, told apart by colour-blind eyes and
/// in grey print by their darkness. NaN is grey, what lies outside gets the colour of the end.
[[nodiscard]] std::string signed_colour(double share);

/// The largest finite magnitude; 0 without one.
[[nodiscard]] double largest_magnitude(const PanelField& field);

/// At most 64 by 36 cells: a finer field is averaged, and cells nobody measured stay out of the
/// mean. A field whose size does not fit its values becomes empty.
[[nodiscard]] PanelField coarser(const PanelField& field);

/// One rectangle per cell of coarser(field), `height_over_width` as the panel's, full colour at
/// `full_scale`. `what` is the picture's name for people who cannot see it.
[[nodiscard]] std::string field_svg(const PanelField& field, double height_over_width,
                                    double full_scale, const std::string& what);

/// The colours from -full_scale to full_scale with numbers beside them, in `unit`.
[[nodiscard]] std::string colour_bar_svg(double full_scale, const std::string& unit);

/// Light over the place under the lens, as bars.
[[nodiscard]] std::string spot_svg(const LensSpot& spot);

/// The rig's local map at the middles of cells.
[[nodiscard]] PanelField field_of(const optics::ResidualMap& map);

}  // namespace lenticule::calib
