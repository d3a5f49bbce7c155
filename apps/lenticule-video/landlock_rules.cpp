// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-video/landlock_rules.h"

#include <fcntl.h>
#include <linux/landlock.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <utility>

namespace lenticule::video {
namespace {

// Rights that are younger than the headers of Debian 12.
constexpr uint64_t kTruncate = uint64_t{1} << 14;
constexpr uint64_t kControlDevice = uint64_t{1} << 15;

constexpr uint64_t kFirstRights = (LANDLOCK_ACCESS_FS_MAKE_SYM << 1) - 1;
constexpr int kVersionWithRefer = 2;
constexpr int kVersionWithTruncate = 3;
constexpr int kVersionWithControl = 5;

/// Returns all rights on files that this version of the interface knows.
uint64_t rights_of(long version) {
  uint64_t rights = kFirstRights;
  if (version >= kVersionWithRefer) rights |= LANDLOCK_ACCESS_FS_REFER;
  if (version >= kVersionWithTruncate) rights |= kTruncate;
  if (version >= kVersionWithControl) rights |= kControlDevice;
  return rights;
}

}  // namespace

std::optional<LandlockRules> LandlockRules::create() {
  const long version =
      ::syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
  if (version < 1) return std::nullopt;
  // Kernels accept this first version of the structure, which has rights on files only.
  const uint64_t handled = rights_of(version);
  const struct { uint64_t handled_access_fs; } attributes{handled};
  UniqueFd rules(
      static_cast<int>(::syscall(SYS_landlock_create_ruleset, &attributes, sizeof attributes, 0)));
  if (!rules) return std::nullopt;
  return LandlockRules(std::move(rules), handled);
}

LandlockRules::LandlockRules(UniqueFd rules, uint64_t handled)
    : rules_(std::move(rules)), handled_(handled) {}

bool LandlockRules::allow_device(const std::string& node) {
  return allow(node, LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_WRITE_FILE | kControlDevice);
}

bool LandlockRules::allow_listing(const std::string& folder) {
  return allow(folder, LANDLOCK_ACCESS_FS_READ_DIR);
}

bool LandlockRules::allow(const std::string& path, uint64_t rights) {
  const UniqueFd target(::open(path.c_str(), O_PATH | O_CLOEXEC));
  if (!target) return false;
  landlock_path_beneath_attr rule{};
  rule.allowed_access = rights & handled_;
  rule.parent_fd = target.get();
  return ::syscall(SYS_landlock_add_rule, rules_.get(), LANDLOCK_RULE_PATH_BENEATH, &rule, 0) == 0;
}

bool LandlockRules::enforce() const {
  return ::syscall(SYS_landlock_restrict_self, rules_.get(), 0) == 0;
}

}  // namespace lenticule::video
