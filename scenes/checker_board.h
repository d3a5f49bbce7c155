// SPDX-License-Identifier: Apache-2.0
// CheckerBoard is a parallelogram of squares in two colours, for floors, walls and boards.
#pragma once

#include "scenes/scene_writer.h"

namespace lenticule::scenes {

struct CheckerBoard {
  Vec3 corner;
  Vec3 along;   ///< edge that is divided into columns
  Vec3 across;  ///< edge that is divided into rows; the visible side is along x across
  int columns = 1;
  int rows = 1;
  Fill even;  ///< fill of the square at the corner
  Fill odd;
};

void write_checker_board(SceneWriter& out, const CheckerBoard& board);

}  // namespace lenticule::scenes
