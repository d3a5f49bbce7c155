// SPDX-License-Identifier: Apache-2.0
#include "scenes/checker_board.h"

#include <array>

namespace lenticule::scenes {
namespace {

void write_squares(SceneWriter& out, const CheckerBoard& board, int parity) {
  // Corners are computed from the whole edge, so that neighbouring squares share them exactly.
  const auto point = [&](int column, int row) {
    return board.corner + board.along * (static_cast<double>(column) / board.columns) +
           board.across * (static_cast<double>(row) / board.rows);
  };
  for (int row = 0; row < board.rows; ++row)
    for (int column = (row + parity) % 2; column < board.columns; column += 2)
      out.polygon(std::array{point(column, row), point(column + 1, row), point(column + 1, row + 1),
                             point(column, row + 1)});
}

}  // namespace

void write_checker_board(SceneWriter& out, const CheckerBoard& board) {
  out.fill(board.even);
  write_squares(out, board, 0);
  out.fill(board.odd);
  write_squares(out, board, 1);
}

}  // namespace lenticule::scenes
