// SPDX-License-Identifier: Apache-2.0
// Draws random but realistic sheets, cameras and links, for tests over many of them.
#pragma once

#include "calib/simulation/portable_random.h"
#include "calib/simulation/simulated_camera.h"
#include "calib/simulation/simulated_link.h"
#include "calib/simulation/simulated_sheet.h"
#include "optics/panel.h"

namespace lenticule::calib {

/// Returns a sheet with 4 to 40 subpixels per lens, a slant up to 30 degrees, a viewing cone of 8
/// to 24 degrees, nearly in focus, deformed by up to 0.15 lens.
[[nodiscard]] SimulatedSheet random_sheet(PortableRandom& random, const optics::Panel& panel);

/// Returns an ordinary webcam on a tripod, viewpoint 0 (left), 1 (middle) or 2 (right): about 700
/// mm away and 250 mm to the side, looking roughly at the middle, with the panel over 55 to 80 % of
/// the picture's width. Lens and sensor are random too: for one camera at several viewpoints, call
/// this function once and use random_place for the others.
[[nodiscard]] SimulatedCamera random_camera(PortableRandom& random, const optics::Panel& panel,
                                            int viewpoint);

/// Sets only position_mm, look_at_mm and roll_degrees, as in random_camera.
void random_place(PortableRandom& random, int viewpoint, SimulatedCamera& camera);

/// Returns a link without faults to a panel with a response time of 5 to 10 ms.
[[nodiscard]] SimulatedPanelLink random_link(PortableRandom& random);

}  // namespace lenticule::calib
