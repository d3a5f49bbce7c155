// SPDX-License-Identifier: Apache-2.0
// OutputWish is a request for an output: the panel, its identity and the size of the frames.
#pragma once

#include "display/kms/probe/output_key.h"
#include "frames/frame.h"
#include "optics/rig.h"

namespace lenticule::display {

enum class IdentityPolicy {
  Require,  ///< the panel must be the one for which the rig was made
  Ignore,   ///< any connected panel, for test cards and measurements
};

struct OutputWish {
  OutputKey key;
  optics::PanelIdentity identity;  ///< panel identity in the rig; empty = any
  frames::FrameGeometry panel;
  IdentityPolicy policy = IdentityPolicy::Require;
};

}  // namespace lenticule::display
