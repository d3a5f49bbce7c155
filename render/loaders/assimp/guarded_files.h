// SPDX-License-Identifier: Apache-2.0
// GuardedFiles restricts the files that assimp may open to regular files of limited size,
// read-only.
#pragma once

#include <assimp/IOSystem.hpp>
#include <cstdint>
#include <string>
#include <vector>

namespace lenticule::render {

/// GuardedFiles reads each file completely before assimp gets it, so that a scene can name neither
/// an endless pipe nor a device, and cannot cause writes. Finds files whose names differ in the
/// case of letters only.
class GuardedFiles : public Assimp::IOSystem {
 public:
  GuardedFiles() = default;
  /// Presents `bytes` as the content of one file.
  GuardedFiles(std::string replaced, std::vector<uint8_t> bytes)
      : replaced_(std::move(replaced)), bytes_(std::move(bytes)) {}

  bool Exists(const char* file) const override;
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* file, const char* mode) override;
  void Close(Assimp::IOStream* stream) override;

 private:
  std::string replaced_;
  std::vector<uint8_t> bytes_;
};

}  // namespace lenticule::render
