// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as an EDID, also with a corrected checksum, which reaches more of the reader.
#include <cstdlib>
#include <vector>

#include "display/kms/device/edid.h"

namespace {

void read(std::span<const uint8_t> bytes) {
  using namespace lenticule::display;
  const EdidReading reading = read_edid(bytes);
  for (const PixelSize size : reading.native_sizes())
    if (size.width < 1 || size.width > 65536 || size.height < 1 || size.height > 65536)
      std::abort();
  if (reading.identity.has_value() != (reading.problem == EdidProblem::None)) std::abort();
  if (!reading.identity) return;
  for (const char character : to_string(*reading.identity))
    if (character < ' ' || character > '~') std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  read({data, size});
  std::vector<uint8_t> repaired(data, data + size);
  if (repaired.size() < 128) return 0;
  uint8_t sum = 0;
  for (size_t i = 0; i < 8; ++i) repaired[i] = i == 0 || i == 7 ? 0x00 : 0xff;
  for (size_t i = 0; i < 127; ++i) sum = static_cast<uint8_t>(sum + repaired[i]);
  repaired[127] = static_cast<uint8_t>(-sum);
  read(repaired);
  return 0;
}
