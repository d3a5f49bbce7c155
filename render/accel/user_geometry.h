// SPDX-License-Identifier: Apache-2.0
// Spheres, cones and wide triangles as Embree user geometry: exact outlines, no tessellation.
#pragma once

#include <vector>

#include "base/cpu.h"
#include "render/accel/embree.h"
#include "render/accel/quadric_kernel.h"
#include "render/accel/quadrics.h"
#include "render/accel/wide_triangle.h"

namespace lenticule::render {

/// Committed geometries, ready to be attached. The lists must stay where they are while Embree uses
/// them.
[[nodiscard]] EmbreeGeometry make_sphere_geometry(RTCDevice device,
                                                  const std::vector<SphereShape>& spheres);
[[nodiscard]] EmbreeGeometry make_cone_geometry(RTCDevice device,
                                                const std::vector<ConeShape>& cones);
/// Rays that meet them are told the numbers of the mesh and the triangle.
[[nodiscard]] EmbreeGeometry make_wide_geometry(RTCDevice device,
                                                const std::vector<WideTriangle>& triangles);

/// What packets are met with; the machine must support it.
[[nodiscard]] const quadric_kernel::Kernel& quadric_kernel_for(Isa isa);

}  // namespace lenticule::render
