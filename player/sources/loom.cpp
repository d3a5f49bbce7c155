// SPDX-License-Identifier: Apache-2.0
#include "player/sources/loom.h"

#include "player/sources/content_flags.h"

namespace lenticule::player {

Loom::Loom(const optics::Rig& rig, const frames::ViewShape& shape, const LoomOptions& options)
    : weaver_(std::make_shared<const frames::WeavePlan>(optics::OpticalModel(rig), shape,
                                                        options.weave),
              options.threads),
      crosstalk_(crosstalk_of(options.crosstalk, rig, shape.count)) {}

void Loom::weave(const frames::ViewSet& views, frames::WovenFrame& frame) {
  if (crosstalk_)
    weaver_.weave(frames::compensate(views, *crosstalk_), frame);
  else
    weaver_.weave(views, frame);
}

}  // namespace lenticule::player
