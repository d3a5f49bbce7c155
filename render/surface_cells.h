// SPDX-License-Identifier: Apache-2.0
// How surfaces are cut into cells of a few millimetres. The shading kernel finds the cell of a
// point; render/shaft.cpp says where a cell is.
#pragma once

#include <cstdint>

namespace lenticule::render {

/// About as wide as a cell, in millimetres on the glass.
inline constexpr float kCellSize = 4.0F;
/// A primitive has no more than this many cells along each direction.
inline constexpr int kMostCells = 64;
/// Directions are told apart on an octahedron that is unfolded to a square of that many bins.
inline constexpr int kDirectionBins = 32;

/// Triangles: u and v, barycentric, in `divisions` parts each. Spheres: the outer normal on the
/// unfolded octahedron. Cones: the direction from the axis on it, and w, the place along the axis,
/// in `divisions_along` parts.
struct SurfaceCell {
  uint32_t geometry = 0;
  uint32_t primitive = 0;
  bool outer_side = true;  ///< on which side rays leave
  int u = 0, v = 0, w = 0;
  int divisions = 1;
  int divisions_along = 1;

  friend bool operator==(const SurfaceCell&, const SurfaceCell&) = default;
};

}  // namespace lenticule::render
