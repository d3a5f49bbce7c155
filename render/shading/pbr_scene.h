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
#include "render/shading/mip_maps.h"
#include "render/shading/pbr_shading.h"
#include "render/shading/surface.h"

namespace lenticule::render {

/// RayFootprint is the part of a surface that one ray stands for: the sides of a parallelogram
/// across the ray, in the scene frame.
struct RayFootprint {
  Vec3 across{};
  Vec3 along{};
};

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

  /// Lights with an intensity of 1; see Scene::lights for their colours.
  [[nodiscard]] const std::vector<SceneLight>& unit_lights() const { return unit_lights_; }

 private:
  /// Input is a texture of a material.
  struct Input {
    const MipMaps* maps = nullptr;  ///< null: there is no texture
    int uv_set = 0;
    std::array<double, 6> uv_map{};
  };
  struct MaterialInputs {
    Input base_colour, metallic_roughness, normal, occlusion, emission, specular, specular_colour,
        clearcoat, clearcoat_roughness, clearcoat_normal, sheen_colour, sheen_roughness,
        transmission, thickness, iridescence, iridescence_thickness, anisotropy;
  };
  /// Position on a mesh, with the change of barycentric coordinates across the footprint.
  struct Place {
    const MeshShape* mesh = nullptr;
    std::array<uint32_t, 3> corners{};
    Barycentric at{};
    Vec2 across{}, along{};
    Vec3 edge1{}, edge2{};
    Vec3 normal{};      ///< shading normal, on the front
    double bend = 0.0;  ///< square of the angle by which the normal changes across the footprint
  };
  /// Unit vectors along the texture's axes, perpendicular to the normal, on the front.
  struct TangentFrame {
    Vec3 tangent, bitangent;
  };

  [[nodiscard]] Input input(const TextureUse& use, MipMaps::Content content);
  [[nodiscard]] static Place place_of(const Scene& scene, const Surface& surface, Vec3 direction,
                                      const RayFootprint& footprint);
  [[nodiscard]] static std::optional<MipMaps::Value> value(const Input& input, const Place& place);
  [[nodiscard]] static TangentFrame tangents(const Input& input, const Place& place);
  /// Returns the mean vector of a normal map in the scene frame, on the front.
  [[nodiscard]] static Vec3 mapped_normal(const Input& input, double scale, const Place& place);
  /// Returns the base colour and the alpha before the alpha mode is applied.
  [[nodiscard]] static MipMaps::Value base_of(const PbrMaterial& material, const Input& input,
                                              const Place& place);
  void set_environment(bool has_studio);

  const Scene& scene_;
  std::vector<std::shared_ptr<const MipMaps>> maps_;
  std::vector<MaterialInputs> inputs_;  ///< by material
  std::shared_ptr<const EnvironmentLight> environment_;
  PbrShader::Frame frame_;
  ToneMap tone_map_;
  bool any_passes_ = false;
  std::vector<SceneLight> unit_lights_;
};

/// Returns the metallic-roughness material that is most like a Whitted one.
[[nodiscard]] PbrMaterial pbr_like(const Material& material);

}  // namespace lenticule::render
