// SPDX-License-Identifier: Apache-2.0
// Reads any text as a camera path: the result is an Error, or poses from which a stage can be made.
#include <cstdint>

#include "base/error.h"
#include "render/loaders/animation.h"
#include "render/scene/stage.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lenticule;
  try {
    for (const render::Camera& c :
         render::parse_camera_path({reinterpret_cast<const char*>(data), size}, "fuzz")) {
      LENTICULE_CHECK(is_finite(c.from) && is_finite(c.at) && is_finite(c.up));
      LENTICULE_CHECK(!(c.from == c.at) && render::up_is_usable(c));
      LENTICULE_CHECK(c.vertical_fov_degrees > 0.0 && c.vertical_fov_degrees < 180.0);
    }
  } catch (const Error& error) {
    LENTICULE_CHECK(error.kind() == ErrorKind::Input);
  }
  return 0;
}
