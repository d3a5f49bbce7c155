// SPDX-License-Identifier: Apache-2.0
// Reads and writes PPM files, in which the harness and the guest's test programs exchange pictures.
#pragma once

#include <cstdint>
#include <string>

namespace lenticule::vm {

// An 8-bit PPM in memory: width * height * 3 bytes.
struct Ppm {
  uint32_t width = 0, height = 0;
  std::string rgb;
};

// Both functions throw std::runtime_error.
Ppm read_ppm(const std::string& path);
void write_ppm(const std::string& path, const Ppm& picture);

}  // namespace lenticule::vm
