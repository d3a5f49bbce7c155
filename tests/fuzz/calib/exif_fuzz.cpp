// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as a JPEG file that states its focal length in EXIF: the result is a possible
// focal length, or nothing. The file without its owner's data states the same, and is the same when
// that is done twice.
#include <vector>

#include "base/error.h"
#include "calib/phone/exif.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  // The copy has exactly the file's size, so that the sanitizer finds a read of one byte more.
  const std::vector<uint8_t> bytes(data, data + size);
  const auto focal = lenticule::calib::stated_focal_35mm(std::span<const uint8_t>(bytes));
  LENTICULE_CHECK(!focal || (*focal > 0.0 && *focal <= 10000.0));
  const std::vector<uint8_t> bare = lenticule::calib::anonymous_jpeg(bytes);
  LENTICULE_CHECK(bare.empty() || lenticule::calib::anonymous_jpeg(bare) == bare);
  LENTICULE_CHECK(bare.empty() ||
                  lenticule::calib::stated_focal_35mm(std::span<const uint8_t>(bare)) == focal);
  return 0;
}
