// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as a glTF file, without other files: the result is an Error, or a scene that can
// be traced at any time.
#include <cstdint>
#include <optional>

#include "render/loaders/formats.h"
#include "tests/fuzz/loaders/scene_checks.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lenticule::render;
  try {
    const SceneDescription scene = parse_gltf({data, data + size}, "fuzz", std::nullopt);
    for (const double seconds : {0.0, 0.3, 1e9}) check_scene(at_time(scene, seconds));
  } catch (const lenticule::Error& error) {
    LENTICULE_CHECK(error.kind() == lenticule::ErrorKind::Input);
  }
  return 0;
}
