// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as a wall file: the result is an Error with a line, or a wall whose panels are
// rotated and moved, but not scaled.
#include <cmath>
#include <string_view>

#include "base/error.h"
#include "optics/wall/wall.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lenticule::optics;
  Wall wall;
  try {
    wall = parse_wall({reinterpret_cast<const char*>(data), size}, "fuzz.toml");
  } catch (const lenticule::Error& error) {
    LENTICULE_CHECK(std::string_view(error.what()).substr(0, 10) == "fuzz.toml:");
    return 0;
  }
  for (const WallPanel& panel : wall.panels)
    LENTICULE_CHECK(std::abs(wall_from_panel(panel).determinant() - 1.0) < 1e-12);
  return 0;
}
