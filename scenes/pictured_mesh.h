// SPDX-License-Identifier: Apache-2.0
// PicturedMesh is a textured triangle mesh; with functions for the few shapes that built-in scenes
// use.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "optics/vec.h"
#include "scenes/elements.h"

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
