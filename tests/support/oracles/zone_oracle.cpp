// SPDX-License-Identifier: Apache-2.0
#include "tests/support/oracles/zone_oracle.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace lenticule::test {

bool oracle_eye_sees(const optics::OpticalModel& model, int i, int j, int channel,
                     const optics::Eye& eye) {
  const optics::Panel& panel = model.rig().panel;
  const double sigma = model.rig().sheet.spot_sigma.value;
  const auto phase = [&](int column) {
    const Vec2 at = panel.subpixel_centre_px(column, j, channel);
    return model.phase(at.x, at.y, channel, eye);
  };
  // All subpixels of the row within two lenses, and those of irregular layouts.
  const int around = 6 + static_cast<int>(2.0 * model.rig().sheet.pitch.value / 3.0);
  std::vector<double> neighbours;
  for (int k = std::max(i - around, 0); k <= std::min(i + around, panel.width_px - 1); ++k)
    neighbours.push_back(phase(k));
  const double own = phase(i);
  for (const double lens : {std::floor(own), std::ceil(own)}) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const double other : neighbours) nearest = std::min(nearest, std::abs(other - lens));
    const double d = std::abs(own - lens);
    if (d * d - nearest * nearest <= 32.0 * sigma * sigma) return true;
  }
  return false;
}

optics::Eye eye_in(const optics::OpticalModel& model, const optics::ViewingZone& zone, double right,
                   double far) {
  const optics::ViewingLine& line = model.rig().viewing;
  return {.x = line.centre.value + zone.x_mm.low + right * zone.x_mm.width(),
          .y = line.height.value,
          .z_mm = zone.z_mm->low + far * zone.z_mm->width()};
}

bool oracle_zone_sees(const optics::OpticalModel& model, const optics::ViewingZone& zone, int i,
                      int j, int channel, int across, int deep) {
  for (int a = 0; a < across; ++a)
    for (int d = 0; d < deep; ++d) {
      const optics::Eye eye = eye_in(model, zone, a / (across - 1.0), d / (deep - 1.0));
      if (oracle_eye_sees(model, i, j, channel, eye)) return true;
    }
  return false;
}

}  // namespace lenticule::test
