// SPDX-License-Identifier: Apache-2.0
// ShadingTables holds a scene's materials, shapes and lights in the form that
// render/shading/shading_kernel.h reads.
#pragma once

#include <deque>
#include <vector>

#include "base/cpu.h"
#include "render/scene/scene.h"
#include "render/scene/surface_cells.h"
#include "render/shading/shading_kernel.h"

namespace lenticule::render {

/// Writes a vector to a table of a kernel.
template <class T>
void write(Vec3 v, T (&out)[3]) {
  out[0] = static_cast<T>(v.x);
  out[1] = static_cast<T>(v.y);
  out[2] = static_cast<T>(v.z);
}

/// ShadingTables is made from a scene. Thread safety: immutable. Lifetime: points into the scene.
class ShadingTables {
 public:
  explicit ShadingTables(const Scene& scene);
  ShadingTables(const ShadingTables&) = delete;
  ShadingTables& operator=(const ShadingTables&) = delete;

  [[nodiscard]] const shading_kernel::Tables& tables() const { return tables_; }
  [[nodiscard]] const std::vector<shading_kernel::Light>& lights() const { return lights_; }
  /// Returns an upper bound, in any channel, of the light along a ray that may be mirrored or
  /// refracted `generations` more times; infinite if no bound is known.
  [[nodiscard]] float most_light(int generations) const;
  /// Returns false if a surface or light may subtract light because of negative numbers; then the
  /// light still to be added has no lower bound.
  [[nodiscard]] bool light_only_adds() const { return light_only_adds_; }

 private:
  std::vector<shading_kernel::Material> materials_;
  std::vector<shading_kernel::Quadric> spheres_;
  std::vector<shading_kernel::Quadric> cones_;
  std::deque<shading_kernel::WideQuadric> wide_quadrics_;  ///< stable addresses
  std::vector<shading_kernel::WideTriangle> wide_triangles_;
  std::vector<shading_kernel::Geometry> geometries_;
  std::vector<shading_kernel::Light> lights_;
  shading_kernel::Tables tables_{};
  bool light_only_adds_ = true;
  float most_direct_ = 0.0F;  ///< light of a surface itself or of the environment
  float most_kept_ = 0.0F;    ///< largest share of mirrored plus refracted light
};

/// Returns the surface cell that an active lane of an intersected packet met.
[[nodiscard]] SurfaceCell cell_of(const RTCRayHit16& packet,
                                  const shading_kernel::Surfaces& surfaces, size_t lane);

/// Returns the kernel for `isa`, which the machine must support (base/cpu.h).
[[nodiscard]] const shading_kernel::Kernel& shading_kernel_for(Isa isa);

}  // namespace lenticule::render
