// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as another system's calibration: the result is an Error, or a rig that can be
// exported.
#include <cmath>
#include <string_view>

#include "base/error.h"
#include "optics/calibration_import.h"
#include "optics/model.h"

namespace {

using namespace lenticule::optics;

double phase_at_centre(const Rig& rig) {
  const OpticalModel model(rig);
  const lenticule::Vec2 q =
      rig.panel.subpixel_centre_px(rig.panel.width_px / 2, rig.panel.height_px / 2, 0);
  return model.phase(q.x, q.y, 0, model.design_eye());
}

void check_same_phase(const Rig& a, const Rig& b) {
  const double difference = phase_at_centre(a) - phase_at_centre(b);
  LENTICULE_CHECK(std::abs(std::remainder(difference, 1.0)) < 1e-6);
}

void try_looking_glass(std::string_view text) {
  LookingGlassImport first;
  try {
    first = import_looking_glass(text, "fuzz.json");
  } catch (const lenticule::Error&) {
    return;
  }
  const std::string exported = export_looking_glass(first.rig, first.views);
  check_same_phase(first.rig, import_looking_glass(exported, "again").rig);
}

void try_cubevi(std::string_view text) {
  Rig rig;
  try {
    rig = import_cubevi(text, "fuzz.json");
  } catch (const lenticule::Error&) {
    return;
  }
  check_same_phase(rig, import_cubevi(export_cubevi(rig), "again"));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  try_looking_glass(text);
  try_cubevi(text);
  return 0;
}
