// SPDX-License-Identifier: Apache-2.0
// Pictures that surfaces of built-in scenes wear. Nothing is read from files: every picture is
// computed.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "optics/vec.h"

namespace lenticule::scenes {

/// Colours are code values from 0 to 1, as NFF's are.
struct Picture {
  std::string name;
  int width = 0;
  int height = 0;
  std::vector<float> rgb;  ///< width * height * 3, rows from the top

  /// What the picture looks like from far away.
  [[nodiscard]] Vec3 mean() const;
};
using SharedPicture = std::shared_ptr<const Picture>;

// Each of these is computed once and continues seamlessly where it is repeated, but for the
// painting. Safe from any thread.

/// Two by two squares, pale and dark.
[[nodiscard]] SharedPicture checker_picture();
/// White stone with dark veins.
[[nodiscard]] SharedPicture marble_picture();
/// Four floor boards, one above the other, their grain along u.
[[nodiscard]] SharedPicture wood_picture();
/// Eight courses of red bricks in mortar, each shifted by half a brick.
[[nodiscard]] SharedPicture brick_picture();
/// Rows of diamonds, for a rug.
[[nodiscard]] SharedPicture weave_picture();
/// A landscape: hills, a lake and a low sun.
[[nodiscard]] SharedPicture painting_picture();

}  // namespace lenticule::scenes
