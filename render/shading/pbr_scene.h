// SPDX-License-Identifier: Apache-2.0
// PbrScene holds what metallic-roughness shading needs of a scene: filtered textures, the light of
// the environment and the tone map.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "render/scene/scene.h"
#include "render/shading/environment_light.h"
#include "render/shading/pbr_inputs.h"
#include "render/shading/pbr_shading.h"
#include "render/shading/pbr_tables.h"
#include "render/shading/surface.h"
#include "render/textures/mip_maps.h"

namespace lenticule::render {

/// PbrSurface is a point with its material's values.
struct PbrSurface {
  const PbrMaterial* material = nullptr;
  PbrPoint point{};
  double thickness = 0.0;  ///< world units; 0 if the surface is thin
};

/// PbrScene is made from a scene whose materials are all metallic-roughness. Thread safety:
/// immutable. Lifetime: points into the scene.
class PbrScene {
 public:
  /// `has_studio` lights the scene with the studio unless the backdrop is a picture or the sky;
  /// otherwise the scene's ambient light comes from all directions.
  PbrScene(const Scene& scene, bool has_studio);

  [[nodiscard]] const EnvironmentLight& environment() const { return *environment_; }
  [[nodiscard]] const PbrShader::Frame& frame() const { return frame_; }
  [[nodiscard]] ToneMap tone_map() const { return tone_map_; }
  /// Returns the light, as shown, of a ray that leaves the scene at `origin`. `roughness` is that
  /// of the surfaces that transmitted the ray.
  [[nodiscard]] Vec3 backdrop(Vec3 origin, Vec3 direction, double roughness) const;

  /// Returns false if all rays end at the first surface that they meet from its front.
  [[nodiscard]] bool any_passes() const { return any_passes_; }
  /// Returns the share of the light that goes through a point unchanged, for shadow rays: of cut
  /// out, blended and transmitting surfaces. Each channel is 0 on opaque surfaces.
  [[nodiscard]] Vec3 passed(const Surface& surface) const;

  [[nodiscard]] PbrSurface surface(const Surface& at, Vec3 direction,
                                   const RayFootprint& footprint) const;
  /// Returns the textures of a material by its number.
  [[nodiscard]] const MaterialInputs& inputs(size_t material) const { return inputs_[material]; }
  /// Returns the scene in the form that render/shading/pbr_kernel.h reads.
  [[nodiscard]] const PbrTables& tables() const { return *tables_; }
  [[nodiscard]] const Affine& panel_from_scene() const { return panel_from_scene_; }

  /// Lights with an intensity of 1; see Scene::lights for their colours.
  [[nodiscard]] const std::vector<SceneLight>& unit_lights() const { return unit_lights_; }

 private:
  [[nodiscard]] MaterialInput input(const TextureUse& use, MipMaps::Content content);
  [[nodiscard]] const MaterialInputs& inputs_of(const Surface& surface) const {
    return inputs_[static_cast<size_t>(surface.material - scene_.materials.data())];
  }
  void set_environment(bool has_studio);

  const Scene& scene_;
  std::vector<std::shared_ptr<const MipMaps>> maps_;
  std::vector<MaterialInputs> inputs_;  ///< by material
  std::shared_ptr<const EnvironmentLight> environment_;
  PbrShader::Frame frame_;
  ToneMap tone_map_;
  Affine panel_from_scene_;
  bool any_passes_ = false;
  std::unique_ptr<const PbrTables> tables_;
  std::vector<SceneLight> unit_lights_;
};

/// Returns the metallic-roughness material that is most like a Whitted one.
[[nodiscard]] PbrMaterial pbr_like(const Material& material);

}  // namespace lenticule::render
