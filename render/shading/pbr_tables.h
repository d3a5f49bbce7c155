// SPDX-License-Identifier: Apache-2.0
// PbrTables holds a scene's metallic-roughness materials and its surroundings in the form that
// render/shading/pbr_kernel.h reads.
#pragma once

#include <vector>

#include "base/cpu.h"
#include "render/rays/tile.h"
#include "render/scene/scene.h"
#include "render/shading/environment_light.h"
#include "render/shading/pbr_kernel.h"
#include "render/shading/pbr_shading.h"

namespace lenticule::render {

/// PbrTables is made from a scene whose materials are all metallic-roughness. Thread safety:
/// immutable. Lifetime: points into the scene and the light.
class PbrTables {
 public:
  PbrTables(const Scene& scene, const EnvironmentLight& light, const PbrShader::Frame& axes);
  PbrTables(const PbrTables&) = delete;
  PbrTables& operator=(const PbrTables&) = delete;

  [[nodiscard]] const pbr_kernel::Tables& tables() const { return tables_; }
  /// Returns false if the kernel cannot shade any of the scene's materials.
  [[nodiscard]] bool any_plain() const { return any_plain_; }
  [[nodiscard]] pbr_kernel::Beam beam(const BeamSize& size) const;

 private:
  std::vector<pbr_kernel::Material> materials_;
  pbr_kernel::Tables tables_{};
  pbr_kernel::Beam axes_{};  ///< without sizes
  bool any_plain_ = false;
};

/// Returns the kernel for `isa`, which the machine must support (base/cpu.h).
[[nodiscard]] const pbr_kernel::Kernel& pbr_kernel_for(Isa isa);

}  // namespace lenticule::render
