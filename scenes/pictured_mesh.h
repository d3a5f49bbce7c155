// SPDX-License-Identifier: Apache-2.0
// PicturedMesh is a textured triangle mesh; with functions for the few shapes that built-in scenes
// use.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "scenes/elements.h"
#include "scenes/picture.h"

namespace lenticule::scenes {

struct PicturedMesh {
  Fill fill{};  ///< the fill's colour multiplies the picture
  SharedPicture picture{};
  std::vector<Vec3> positions{};
  std::vector<Vec3> normals{};              ///< per position, unit; empty for flat shading
  std::vector<std::array<float, 2>> uvs{};  ///< per position; v = 0 at the picture's top
  std::vector<std::array<uint32_t, 3>> triangles{};
};

/// PicturedBoard is a parallelogram that repeats its picture `columns` times along and `rows` times
/// across. The picture's top left is at `corner`; `along` is its top edge, `across` its left edge.
struct PicturedBoard {
  Vec3 corner;
  Vec3 along;
  Vec3 across;
  double columns = 1.0;
  double rows = 1.0;
};
void append_board(PicturedMesh& mesh, const PicturedBoard& board);

/// Appends the six sides of a box with edges along the axes; each side repeats the picture once per
/// `unit`.
void append_box(PicturedMesh& mesh, Vec3 low, Vec3 high, double unit);

/// Appends a ball with its poles along z, with `cuts` divisions from pole to pole and twice as many
/// around: 4 cuts (cuts - 1) triangles with the ball's normals. The picture covers the ball once.
void append_ball(PicturedMesh& mesh, Vec3 centre, double radius, int cuts);

}  // namespace lenticule::scenes
