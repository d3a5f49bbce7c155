// SPDX-License-Identifier: Apache-2.0
// LandlockRules restricts which files a process may open, by the kernel's Landlock.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/unique_fd.h"

namespace lenticule::video {

/// LandlockRules is a set of files that stay accessible. After enforce() every other access to
/// files by name that the kernel's Landlock knows is refused; open descriptors keep their rights.
class LandlockRules {
 public:
  /// Returns an empty set; none if the kernel has no Landlock, or a service manager forbids it
  /// (errno states which).
  [[nodiscard]] static std::optional<LandlockRules> create();

  /// Allows to open this device for reading and writing, and to control it. Returns false if the
  /// device is gone.
  [[nodiscard]] bool allow_device(const std::string& node);
  /// Allows to list this folder and those below it.
  [[nodiscard]] bool allow_listing(const std::string& folder);

  /// Restricts the process permanently, which must have no_new_privs and a single thread. Returns
  /// false, and restricts nothing, if the kernel refuses.
  [[nodiscard]] bool enforce() const;

 private:
  LandlockRules(UniqueFd rules, uint64_t handled);
  [[nodiscard]] bool allow(const std::string& path, uint64_t rights);

  UniqueFd rules_;
  uint64_t handled_;  ///< rights that this kernel knows
};

}  // namespace lenticule::video
