// SPDX-License-Identifier: Apache-2.0
// Intersection of ray packets with one sphere, cone or wide triangle, compiled once per instruction
// set. Formulas and their order are those of render/accel/primitives.h and
// render/accel/primitives.h, so the results are bit-identical. Plain data only: this header must
// not bring shared inline functions into a file that is compiled for AVX-512.
#pragma once

#include <cstdint>

#include "base/cpu.h"

namespace lenticule::render::quadric_kernel {

inline constexpr int kMostLanes = 16;

struct Sphere {
  double centre[3];
  double radius;
};

struct Cone {
  double base[3];
  double axis[3];  ///< unit
  double height;
  double base_radius;
  double slope;
};

/// See render/accel/primitives.h.
struct Triangle {
  double corner[3];
  double normal[3];
  double u_axis[3];
  double v_axis[3];
  double slope[3];
  double edge_room;  ///< kEdgeRoom
};

/// Packet refers to a packet in Embree's layout: arrays of `lanes` elements each, beginning with
/// the origins (see packet_kernel::Field); a shadow ray has only the first twelve arrays. On entry,
/// lanes where `valid` is zero are inactive and stay unchanged. On return, `valid` is -1 in lanes
/// that hit the shape and 0 in all others.
struct Packet {
  int lanes;  ///< a multiple of Kernel::step, at most kMostLanes
  int32_t* valid;
  float* rays;
};

/// Kernel holds the functions that Embree's packet callbacks use.
struct Kernel {
  int step;
  void (*intersect_sphere)(const Sphere&, uint32_t geometry, uint32_t primitive, const Packet&);
  void (*occlude_sphere)(const Sphere&, const Packet&);
  void (*intersect_cone)(const Cone&, uint32_t geometry, uint32_t primitive, const Packet&);
  void (*occlude_cone)(const Cone&, const Packet&);
  void (*intersect_triangle)(const Triangle&, uint32_t geometry, uint32_t primitive, const Packet&);
  void (*occlude_triangle)(const Triangle&, const Packet&);
};

}  // namespace lenticule::render::quadric_kernel

namespace lenticule::render {
LENTICULE_DECLARE_KERNEL(quadric_kernel::Kernel, kQuadricKernel)
}
