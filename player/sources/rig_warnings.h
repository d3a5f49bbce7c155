// SPDX-License-Identifier: Apache-2.0
// RigWarnings collects the player's warnings about frames that are shown although they were woven
// before the rig was trimmed.
#pragma once

#include <mutex>
#include <string>
#include <vector>

namespace lenticule::player {

/// RigWarnings prints each warning once. Thread safety: any thread.
class RigWarnings {
 public:
  void add(const std::string& warning);
  [[nodiscard]] std::vector<std::string> all() const;

 private:
  mutable std::mutex mutex_;  ///< guards warnings_
  std::vector<std::string> warnings_;
};

}  // namespace lenticule::player
