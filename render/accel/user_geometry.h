// SPDX-License-Identifier: Apache-2.0
// Spheres, cones and wide triangles as Embree user geometry: exact outlines, no tessellation.
#pragma once

#include <vector>

#include "base/cpu.h"
#include "render/accel/embree.h"
#include "render/accel/primitives.h"
#include "render/accel/quadric_kernel.h"

namespace lenticule::render {

/// Returns a committed geometry, ready to be attached. Lifetime: Embree reads the list in place, so
/// it must not move while Embree uses the geometry.
[[nodiscard]] EmbreeGeometry make_sphere_geometry(RTCDevice device,
                                                  const std::vector<SphereShape>& spheres);
[[nodiscard]] EmbreeGeometry make_cone_geometry(RTCDevice device,
                                                const std::vector<ConeShape>& cones);
/// Hits report the geometry and primitive numbers of the mesh and its triangle.
[[nodiscard]] EmbreeGeometry make_wide_geometry(RTCDevice device,
                                                const std::vector<WideTriangle>& triangles);

/// Returns the kernel for packets; the machine must support `isa`.
[[nodiscard]] const quadric_kernel::Kernel& quadric_kernel_for(Isa isa);

}  // namespace lenticule::render
