// SPDX-License-Identifier: Apache-2.0
// What turns views into a rig's woven frames: plan, threads, and what is undone before.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "frames/weaving/crosstalk.h"
#include "frames/weaving/fast_weaver.h"
#include "optics/rig.h"

namespace lenticule::player {

struct LoomOptions {
  frames::WeaveOptions weave = {};
  std::string crosstalk = {};  ///< as crosstalk_of() takes it
  int threads = 1;
};

/// One caller at a time.
class Loom {
 public:
  /// Makes the plan, which takes most of a second for a 4K panel. Throws Error(Usage) for more
  /// views than a plan takes and for a crosstalk that is none.
  Loom(const optics::Rig& rig, const frames::ViewShape& shape, const LoomOptions& options);

  /// Views of that shape into a frame of the panel's size. Throws only where crosstalk is undone:
  /// Error(Usage) for too many views, std::bad_alloc.
  void weave(const frames::ViewSet& views, frames::WovenFrame& frame);

 private:
  frames::FastWeaver weaver_;
  std::optional<frames::Crosstalk> crosstalk_;
};

}  // namespace lenticule::player
