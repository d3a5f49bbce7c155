// SPDX-License-Identifier: Apache-2.0
// Finds out from the pixels of a picture that it holds two eyes' pictures, beside or above each
// other.
#pragma once

#include <optional>

#include "frames/frame.h"
#include "frames/views_input/content_name.h"

namespace lenticule::frames {

struct StereoPair {
  /// The left eye's picture counts as the first: pixels do not tell. A picture with the shape of a
  /// film's counts as squeezed.
  StereoLayout layout;
  double matching = 0.0;  ///< part of the detail that both halves have
  /// Disparities of the farthest and the nearest tenth, in parts of an eye's width: by how much the
  /// left eye's picture of a point is further right.
  double back = 0.0, front = 0.0;
};

/// Returns nothing unless it is certain. Takes some 10 ms for a picture of any size.
[[nodiscard]] std::optional<StereoPair> find_stereo_pair(const FrameView& picture);

}  // namespace lenticule::frames
