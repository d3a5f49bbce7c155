// SPDX-License-Identifier: Apache-2.0
// Reference implementation of the visibility from a viewing zone: tries eyes on a grid, one
// subpixel at a time.
#pragma once

#include "optics/zone/viewing_zone.h"

namespace lenticule::test {

/// Returns true if the eye sees the subpixel through some lens: its weight is not below e^-16 times
/// that of the subpixel of its row and channel that is nearest to the lens in phase.
bool oracle_eye_sees(const optics::OpticalModel& model, int i, int j, int channel,
                     const optics::Eye& eye);

/// Returns true if any of `across` x `deep` eyes of the zone, its borders included, sees the
/// subpixel. The zone must state its distances.
bool oracle_zone_sees(const optics::OpticalModel& model, const optics::ViewingZone& zone, int i,
                      int j, int channel, int across, int deep);

/// Returns the eye at these parts, 0 to 1, of the zone's width and depth.
optics::Eye eye_in(const optics::OpticalModel& model, const optics::ViewingZone& zone, double right,
                   double far);

}  // namespace lenticule::test
