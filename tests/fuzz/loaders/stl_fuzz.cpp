// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as an STL file: the result is an Error, or a scene that can be traced.
#include <cstdint>

#include "render/loaders/formats.h"
#include "tests/fuzz/loaders/scene_checks.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lenticule::render;
  try {
    check_scene(parse_stl({data, size}, "fuzz"));
  } catch (const lenticule::Error& error) {
    LENTICULE_CHECK(error.kind() == lenticule::ErrorKind::Input);
  }
  return 0;
}
