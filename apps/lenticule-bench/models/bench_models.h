// SPDX-License-Identifier: Apache-2.0
// The part of `lenticule bench models` that tests check: smaller copies of pictures.
#pragma once

#include "frames/frame.h"

namespace lenticule::bench {

/// Returns the picture with squares of factor x factor pixels averaged in linear light. Columns and
/// rows that do not fill a square are left out. Throws Error(Usage) if the factor is below 1 or no
/// square fits.
[[nodiscard]] frames::WovenFrame averaged(const frames::FrameView& picture, int factor);
}  // namespace lenticule::bench
