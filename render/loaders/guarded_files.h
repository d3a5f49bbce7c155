// SPDX-License-Identifier: Apache-2.0
// GuardedFiles restricts the files that assimp may open to regular files of limited size,
// read-only.
#pragma once

#include <assimp/IOSystem.hpp>

namespace lenticule::render {

/// GuardedFiles reads each file completely before assimp gets it, so that a scene can name neither
/// an endless pipe nor a device, and cannot cause writes.
class GuardedFiles : public Assimp::IOSystem {
 public:
  bool Exists(const char* file) const override;
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* file, const char* mode) override;
  void Close(Assimp::IOStream* stream) override;
};

}  // namespace lenticule::render
