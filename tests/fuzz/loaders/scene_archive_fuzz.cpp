// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as the archive of a process that lies: the result is an Error, or a scene that
// can be evaluated at any time and passed on.
#include <cstdint>

#include "tests/support/archive_bytes.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lenticule;
  try {
    const render::SceneDescription scene = test::scene_of({data, size}, size / 2 + 1);
    (void)render::at_time(scene, scene.duration_seconds / 2.0);
    const std::vector<uint8_t> again = test::archive_of(scene);
    LENTICULE_CHECK(test::archive_of(test::scene_of(again)) == again);
  } catch (const Error& error) {
    LENTICULE_CHECK(error.kind() == ErrorKind::Input);
  }
  return 0;
}
