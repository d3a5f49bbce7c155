// SPDX-License-Identifier: Apache-2.0
// Reference implementation of weaving, slow and simple, in long double. It shares no code with
// frames/weave.cpp or optics/model.cpp, and supports rigs without a residual map.
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

  /// Returns the code values that a correct weaver may give this subpixel: one, or two if the
  /// subpixel lies on a border between views or lenses, or if rounding could go either way.
  [[nodiscard]] std::set<int> subpixel(int i, int j, int channel) const;

  /// Returns Phi_E0 of a subpixel.
  [[nodiscard]] long double phase(int i, int j, int channel) const;
};

}  // namespace lenticule::test
