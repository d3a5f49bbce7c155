// SPDX-License-Identifier: Apache-2.0
// Division of surfaces into cells of a few millimetres on the panel. The shading kernel finds the
// cell of a point; render/culling/shaft.cpp computes the geometry of a cell.
#pragma once

#include <cstdint>

namespace lenticule::render {

/// Approximate width of a cell, in scene units.
inline constexpr float kCellSize = 4.0F;
/// Bits of a cell number along each direction, which limit the cells per primitive: the ground of a
/// scene may be metres wide.
inline constexpr int kCellBits = 10;
inline constexpr int kMostCells = 1 << kCellBits;
/// Bits along the axis of a cone. Cones have few cells around their axis.
inline constexpr int kCellBitsAlong = 6;
inline constexpr int kMostCellsAlong = 1 << kCellBitsAlong;
/// Bit layout of a cell's place on its primitive: u, v and w start at these bits; the lowest bit is
/// set on the outer side.
inline constexpr int kPlaceW = 1, kPlaceV = kPlaceW + kCellBitsAlong, kPlaceU = kPlaceV + kCellBits;
inline constexpr int kPlaceBits = kPlaceU + kCellBits;
/// Number of direction bins along each side of the square to which the octahedron of directions is
/// unfolded.
inline constexpr int kDirectionBins = 32;

/// SurfaceCell identifies a cell of a primitive. Triangles: u and v are barycentric, in `divisions`
/// parts each. Spheres: u and v locate the outer normal on the unfolded octahedron. Cones: u and v
/// locate the direction from the axis on the unfolded octahedron, and w is the place along the
/// axis, in `divisions_along` parts.
struct SurfaceCell {
  uint32_t geometry = 0;
  uint32_t primitive = 0;
  bool outer_side = true;  ///< side of the surface on which rays leave
  int u = 0, v = 0, w = 0;
  int divisions = 1;
  int divisions_along = 1;

  friend bool operator==(const SurfaceCell&, const SurfaceCell&) = default;
};

/// Returns the number that the shading kernel computes for the same cell.
[[nodiscard]] constexpr int32_t place_of(const SurfaceCell& cell) {
  return cell.u << kPlaceU | cell.v << kPlaceV | cell.w << kPlaceW | (cell.outer_side ? 1 : 0);
}

}  // namespace lenticule::render
