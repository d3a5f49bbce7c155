// SPDX-License-Identifier: Apache-2.0
// A scene's materials, shapes and lights as render/shading/shading_kernel.h reads them.
#pragma once

#include <deque>
#include <vector>

#include "base/cpu.h"
#include "render/scene/scene.h"
#include "render/scene/surface_cells.h"
#include "render/shading/shading_kernel.h"

namespace lenticule::render {

/// Immutable; points into the scene it was made from.
class ShadingTables {
 public:
  explicit ShadingTables(const Scene& scene);
  ShadingTables(const ShadingTables&) = delete;
  ShadingTables& operator=(const ShadingTables&) = delete;

  [[nodiscard]] const shading_kernel::Tables& tables() const { return tables_; }
  [[nodiscard]] const std::vector<shading_kernel::Light>& lights() const { return lights_; }
  /// More than any ray brings that may be mirrored or refracted `generations` times more, in any
  /// channel; infinite where no bound is known.
  [[nodiscard]] float most_light(int generations) const;
  /// False where something may take light away, which numbers below zero do: then nothing is known
  /// of what is still to come.
  [[nodiscard]] bool light_only_adds() const { return light_only_adds_; }

 private:
  std::vector<shading_kernel::Material> materials_;
  std::vector<shading_kernel::Quadric> spheres_;
  std::vector<shading_kernel::Quadric> cones_;
  std::deque<shading_kernel::WideQuadric> wide_quadrics_;  ///< stay where they are
  std::vector<shading_kernel::WideTriangle> wide_triangles_;
  std::vector<shading_kernel::Geometry> geometries_;
  std::vector<shading_kernel::Light> lights_;
  shading_kernel::Tables tables_{};
  bool light_only_adds_ = true;
  float most_direct_ = 0.0F;  ///< from a surface itself or from the surroundings
  float most_kept_ = 0.0F;    ///< of what a mirrored and a refracted ray bring together
};

/// The cell that an active lane of an intersected packet met.
[[nodiscard]] SurfaceCell cell_of(const RTCRayHit16& packet,
                                  const shading_kernel::Surfaces& surfaces, size_t lane);

/// The machine must support it (optics/cpu.h).
[[nodiscard]] const shading_kernel::Kernel& shading_kernel_for(Isa isa);

}  // namespace lenticule::render
