// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as a rig file: the result is an Error with a line, or a rig that survives a round
// trip and has a finite ray for every subpixel.
#include <cmath>
#include <string_view>

#include "base/error.h"
#include "optics/model.h"
#include "optics/rig_file.h"

namespace {

using namespace lenticule::optics;

void check_rays(const Rig& rig) {
  const OpticalModel model(rig);
  for (const int i : {0, rig.panel.width_px / 3, rig.panel.width_px - 1}) {
    for (const int j : {0, rig.panel.height_px / 2, rig.panel.height_px - 1}) {
      const SubpixelRay ray = model.ray(i, j, 1);
      LENTICULE_CHECK(std::isfinite(ray.lens_x_mm) && std::isfinite(ray.lens_y_mm));
      LENTICULE_CHECK(std::isfinite(ray.tan_x) && std::isfinite(ray.tan_y));
      LENTICULE_CHECK(ray.place >= -0.5 && ray.place < 0.5);
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Rig rig;
  try {
    rig = parse_rig({reinterpret_cast<const char*>(data), size}, "fuzz.toml");
  } catch (const lenticule::Error& error) {
    LENTICULE_CHECK(std::string_view(error.what()).substr(0, 10) == "fuzz.toml:");
    return 0;
  }
  LENTICULE_CHECK(parse_rig(rig_to_toml(rig), "again") == rig);
  check_rays(rig);
  return 0;
}
