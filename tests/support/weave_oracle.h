// SPDX-License-Identifier: Apache-2.0
// Weaving as slowly and plainly as possible, in long double: shares no code with frames/weave.cpp
// or optics/model.cpp. Takes rigs without a residual map.
#pragma once

#include <set>

#include "frames/frame.h"
#include "frames/quilt.h"
#include "frames/weave.h"
#include "optics/rig.h"

namespace lenticule::test {

struct WeaveOracle {
  const optics::Rig& rig;
  const frames::WovenFrame& quilt;
  frames::QuiltLayout layout;
  frames::WeaveOptions options;

  /// The code values that a right weaver may give this subpixel: one, or two where it lies on a
  /// border between views or lenses, or where rounding could go either way.
  [[nodiscard]] std::set<int> subpixel(int i, int j, int channel) const;

  /// Phi_E0 of a subpixel.
  [[nodiscard]] long double phase(int i, int j, int channel) const;
};

}  // namespace lenticule::test
