// SPDX-License-Identifier: Apache-2.0
// Packets of rays against one sphere, cone or wide triangle, compiled once per instruction set. The
// formulas, their order and so every bit are those of render/accel/quadrics.h and
// render/accel/wide_triangle.h. Plain data only: nothing here may bring a shared inline function
// into a file that is compiled for AVX-512.
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

/// See render/accel/wide_triangle.h.
struct Triangle {
  double corner[3];
  double normal[3];
  double u_axis[3];
  double v_axis[3];
  double slope[3];
  double edge_room;  ///< kEdgeRoom
};

/// A packet as Embree has it: arrays of `lanes` elements each, beginning with the origins (see
/// packet_kernel::Field); a shadow ray has no more than the first twelve. Lanes where `valid` is
/// zero stay as they are; then valid becomes -1 where the shape was met, 0 elsewhere.
struct Packet {
  int lanes;  ///< a multiple of Kernel::step, at most kMostLanes
  int32_t* valid;
  float* rays;
};

/// What Embree calls for packets.
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
