// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as a quilt's sidecar: the result is an Error that names the file, nothing, or a
// valid layout.
#include <string_view>

#include "base/error.h"
#include "frames/views_input/content_name.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lenticule::frames;
  try {
    const auto sidecar =
        parse_quilt_sidecar({reinterpret_cast<const char*>(data), size}, "fuzz.json");
    if (!sidecar) return 0;
    LENTICULE_CHECK(sidecar->depth.has_value() != sidecar->columns.has_value());
    LENTICULE_CHECK(sidecar->depthiness >= 0.0 && sidecar->depthiness <= 10.0);
    if (sidecar->columns)
      check_quilt_layout({.columns = *sidecar->columns,
                          .rows = sidecar->rows.value(),
                          .views = sidecar->views.value_or(0)},
                         "fuzz.json");
  } catch (const lenticule::Error& error) {
    LENTICULE_CHECK(std::string_view(error.what()).substr(0, 9) == "fuzz.json");
  }
  return 0;
}
