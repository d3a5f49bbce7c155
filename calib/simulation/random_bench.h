// SPDX-License-Identifier: Apache-2.0
// Sheets and cameras as the world brings them, for tests over many of them.
#pragma once

#include "calib/simulation/portable_random.h"
#include "calib/simulation/simulated_camera.h"
#include "calib/simulation/simulated_link.h"
#include "calib/simulation/simulated_sheet.h"
#include "optics/panel.h"

namespace lenticule::calib {

/// 4 to 40 subpixels per lens, slanted up to 30 degrees, a viewing cone of 8 to 24 degrees, nearly
/// in focus, deformed by up to 0.15 lens.
[[nodiscard]] SimulatedSheet random_sheet(PortableRandom& random, const optics::Panel& panel);

/// An ordinary webcam on a tripod, viewpoint 0 (left), 1 (middle) or 2 (right): some 700 mm away
/// and 250 mm to the side, looking about at the middle, with the panel over 55 to 80 % of the
/// picture's width. Lens and sensor are drawn too: for one camera at several places, draw once and
/// use random_place for the others.
[[nodiscard]] SimulatedCamera random_camera(PortableRandom& random, const optics::Panel& panel,
                                            int viewpoint);

/// Only position_mm, look_at_mm and roll_degrees of random_camera.
void random_place(PortableRandom& random, int viewpoint, SimulatedCamera& camera);

/// A link without faults over a panel that needs 5 to 10 ms to turn.
[[nodiscard]] SimulatedPanelLink random_link(PortableRandom& random);

}  // namespace lenticule::calib
