// SPDX-License-Identifier: Apache-2.0
// WeavingPipeline weaves views into a rig's woven frames: plan, threads, and
// crosstalk compensation.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "frames/weaving/crosstalk.h"
#include "frames/weaving/fast_weaver.h"
#include "optics/rig.h"

namespace lenticule::player {

struct WeavingPipelineOptions {
  frames::WeaveOptions weave = {};
  std::string crosstalk = {};  ///< a value that crosstalk_of() accepts
  int threads = 1;
};

/// Thread safety: one caller at a time.
class WeavingPipeline {
 public:
  /// Makes the plan, which takes a fraction of a second for a 4K panel. Throws Error(Usage) for
  /// more views than a plan can hold and for an invalid crosstalk.
  WeavingPipeline(const optics::Rig& rig, const frames::ViewShape& shape,
                  const WeavingPipelineOptions& options);

  /// Weaves views of that shape into a frame of the panel's size. Throws only with crosstalk
  /// compensation: Error(Usage) for too many views, std::bad_alloc.
  void weave(const frames::ViewSet& views, frames::WovenFrame& frame);

 private:
  frames::FastWeaver weaver_;
  std::optional<frames::Crosstalk> crosstalk_;
};

}  // namespace lenticule::player
