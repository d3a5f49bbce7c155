// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "base/temporary.h"

namespace lenticule::player {

/// ScratchFolder is a temporary folder that its destructor removes. Throws Error(Failed).
class ScratchFolder {
 public:
  ScratchFolder();
  [[nodiscard]] std::string file(const std::string& name) const {
    return (folder_.path() / name).string();
  }

 private:
  TemporaryFolder folder_;
};

}  // namespace lenticule::player
