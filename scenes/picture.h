// SPDX-License-Identifier: Apache-2.0
// Pictures for the surfaces of built-in scenes. All pictures are computed; none is read from a
// file.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "optics/vec.h"

namespace lenticule::scenes {

/// Picture holds colours as code values from 0 to 1, as in NFF.
struct Picture {
  std::string name;
  int width = 0;
  int height = 0;
  std::vector<float> rgb;  ///< width * height * 3, rows from the top

  /// Returns the mean colour, which is the picture's colour from far away.
  [[nodiscard]] Vec3 mean() const;
};
using SharedPicture = std::shared_ptr<const Picture>;

// Each picture is computed once. All except the painting repeat seamlessly. Thread safety: safe
// from any thread.

/// Returns two by two squares, pale and dark.
[[nodiscard]] SharedPicture checker_picture();
/// Returns white stone with dark veins.
[[nodiscard]] SharedPicture marble_picture();
/// Returns four floor boards, one above the other, with grain along u.
[[nodiscard]] SharedPicture wood_picture();
/// Returns eight courses of red bricks in mortar, each shifted by half a brick.
[[nodiscard]] SharedPicture brick_picture();
/// Returns rows of diamonds, for a rug.
[[nodiscard]] SharedPicture weave_picture();
/// Returns a landscape: hills, a lake and a low sun.
[[nodiscard]] SharedPicture painting_picture();

}  // namespace lenticule::scenes
