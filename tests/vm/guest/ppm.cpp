// SPDX-License-Identifier: Apache-2.0
// Reads and writes PPM files.
#include "ppm.h"

#include <fstream>
#include <stdexcept>

namespace lenticule::vm {

Ppm read_ppm(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string magic;
  uint32_t depth = 0;
  Ppm picture;
  file >> magic >> picture.width >> picture.height >> depth;
  file.get();
  if (!file || magic != "P6" || depth != 255 || picture.width > 16384 || picture.height > 16384)
    throw std::runtime_error(path + ": not a PPM of 8 bits");
  picture.rgb.resize(static_cast<size_t>(picture.width) * picture.height * 3);
  file.read(picture.rgb.data(), static_cast<std::streamsize>(picture.rgb.size()));
  if (!file) throw std::runtime_error(path + ": ends early");
  return picture;
}

void write_ppm(const std::string& path, const Ppm& picture) {
  std::ofstream file(path, std::ios::binary);
  file << "P6\n" << picture.width << " " << picture.height << "\n255\n" << picture.rgb;
  if (!file.flush()) throw std::runtime_error(path + ": cannot be written");
}

}  // namespace lenticule::vm
