// SPDX-License-Identifier: Apache-2.0
#include "player/sources/rig_warnings.h"

#include <algorithm>

#include "base/print.h"

namespace lenticule::player {
namespace {

/// Bounds the memory when many renderers connect with different trims.
constexpr size_t kMostWarnings = 100;

}  // namespace

void RigWarnings::add(const std::string& warning) {
  {
    const std::lock_guard lock(mutex_);
    const bool known = std::find(warnings_.begin(), warnings_.end(), warning) != warnings_.end();
    if (known || warnings_.size() >= kMostWarnings) return;
    warnings_.push_back(warning);
  }
  say("lenticule: {}\n  render or weave it again to apply the trim\n", warning);
}

std::vector<std::string> RigWarnings::all() const {
  const std::lock_guard lock(mutex_);
  return warnings_;
}

}  // namespace lenticule::player
