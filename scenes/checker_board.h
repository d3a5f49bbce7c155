// SPDX-License-Identifier: Apache-2.0
// A parallelogram of squares in two colours: floors, walls and boards.
#pragma once

#include "scenes/scene_writer.h"

namespace lenticule::scenes {

struct CheckerBoard {
  Vec3 corner;
  Vec3 along;   ///< edge that the columns divide
  Vec3 across;  ///< edge that the rows divide; the visible side is along x across
  int columns = 1;
  int rows = 1;
  Fill even;  ///< of the square at the corner
  Fill odd;
};

void write_checker_board(SceneWriter& out, const CheckerBoard& board);

}  // namespace lenticule::scenes
