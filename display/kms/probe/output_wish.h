// SPDX-License-Identifier: Apache-2.0
// Which panel is wanted, and for what.
#pragma once

#include "display/kms/probe/output_key.h"
#include "frames/frame.h"
#include "optics/rig.h"

namespace lenticule::display {

enum class IdentityPolicy {
  Require,  ///< the panel must be the one that the rig was made for
  Ignore,   ///< for test cards and measurements: whatever panel is there
};

struct OutputWish {
  OutputKey key;
  optics::PanelIdentity identity;  ///< of the rig; empty = any
  frames::FrameGeometry panel;
  IdentityPolicy policy = IdentityPolicy::Require;
};

}  // namespace lenticule::display
