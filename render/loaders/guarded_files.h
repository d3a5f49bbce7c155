// SPDX-License-Identifier: Apache-2.0
// The files that assimp may open: regular ones of a sane size, read-only.
#pragma once

#include <assimp/IOSystem.hpp>

namespace lenticule::render {

/// Reads each file whole before handing it over, so that a scene can name neither a pipe that never
/// ends nor a device, and cannot write.
class GuardedFiles : public Assimp::IOSystem {
 public:
  bool Exists(const char* file) const override;
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* file, const char* mode) override;
  void Close(Assimp::IOStream* stream) override;
};

}  // namespace lenticule::render
