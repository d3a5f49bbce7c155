// SPDX-License-Identifier: Apache-2.0
#include "player/sources/weaving_pipeline.h"

#include "player/sources/content_flags.h"

namespace lenticule::player {

WeavingPipeline::WeavingPipeline(const optics::Rig& rig, const frames::ViewShape& shape,
                                 const WeavingPipelineOptions& options)
    : weaver_(std::make_shared<const frames::WeavePlan>(optics::OpticalModel(rig), shape,
                                                        options.weave, options.threads),
              options.threads),
      crosstalk_(crosstalk_of(options.crosstalk, rig, shape.count)) {}

void WeavingPipeline::weave(const frames::ViewSet& views, frames::WovenFrame& frame) {
  if (crosstalk_)
    weaver_.weave(frames::compensate(views, *crosstalk_), frame);
  else
    weaver_.weave(views, frame);
}

}  // namespace lenticule::player
