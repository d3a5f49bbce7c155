// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as the kernel's text of a tile: none, or a place within its panel.
#include "base/error.h"
#include "display/kms/device/edid.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto tile = lenticule::display::parse_tile({data, size});
  if (!tile) return 0;
  LENTICULE_CHECK(tile->column >= 0 && tile->column < tile->columns);
  LENTICULE_CHECK(tile->row >= 0 && tile->row < tile->rows && tile->count() <= 64 * 64);
  LENTICULE_CHECK(tile->width >= 1 && tile->width <= 65536);
  LENTICULE_CHECK(tile->height >= 1 && tile->height <= 65536);
  return 0;
}
