// SPDX-License-Identifier: Apache-2.0
// How surfaces are cut into cells of a few millimetres. The shading kernel finds the cell of a
// point; render/culling/shaft.cpp says where a cell is.
#pragma once

#include <cstdint>

namespace lenticule::render {

/// About as wide as a cell, in millimetres on the glass.
inline constexpr float kCellSize = 4.0F;
/// A primitive has no more than this many cells along each direction: bits of a cell's number. The
/// ground of a scene may be metres wide.
inline constexpr int kCellBits = 10;
inline constexpr int kMostCells = 1 << kCellBits;
/// Cones have few around them, and no more than this many along their axis.
inline constexpr int kCellBitsAlong = 6;
inline constexpr int kMostCellsAlong = 1 << kCellBitsAlong;
/// A cell's place on its primitive in one number: from these bits on u, v and w; the lowest is set
/// on the outer side.
inline constexpr int kPlaceW = 1, kPlaceV = kPlaceW + kCellBitsAlong, kPlaceU = kPlaceV + kCellBits;
inline constexpr int kPlaceBits = kPlaceU + kCellBits;
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

/// The same number that the shading kernel makes.
[[nodiscard]] constexpr int32_t place_of(const SurfaceCell& cell) {
  return cell.u << kPlaceU | cell.v << kPlaceV | cell.w << kPlaceW | (cell.outer_side ? 1 : 0);
}

}  // namespace lenticule::render
