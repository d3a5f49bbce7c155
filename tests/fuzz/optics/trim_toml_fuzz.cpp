// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as a trim: the result is an Error with a line, or a trim within its limits.
#include <cmath>
#include <string_view>

#include "base/error.h"
#include "optics/trim.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lenticule::optics;
  try {
    const Trim trim = parse_trim({reinterpret_cast<const char*>(data), size}, "fuzz.toml");
    LENTICULE_CHECK(std::abs(trim.offset.value) <= kMaxTrimOffsetLenses);
    LENTICULE_CHECK(std::abs(trim.pitch_relative) <= kMaxTrimPitch);
  } catch (const lenticule::Error& error) {
    LENTICULE_CHECK(std::string_view(error.what()).substr(0, 10) == "fuzz.toml:");
  }
  return 0;
}
