// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "base/temporary.h"

namespace lenticule::tools {

/// ScratchFolder is a temporary folder that its destructor removes. Throws Error(Failed).
class ScratchFolder {
 public:
  ScratchFolder();
  [[nodiscard]] std::string file(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  /// Returns a place for the socket of a ring, in a folder of its own: a player locks the folder
  /// of its socket, and this folder is locked already. Throws Error(Failed).
  [[nodiscard]] std::string ring_socket() const;

 private:
  TemporaryFolder folder_;
};

}  // namespace lenticule::tools
