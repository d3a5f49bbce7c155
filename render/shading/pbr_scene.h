// SPDX-License-Identifier: Apache-2.0
// PbrScene holds what metallic-roughness shading needs of a scene: filtered textures and their
// values at points of surfaces, the light of the environment, the tone map, and the tables that
// render/shading/pbr_kernel.h reads.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "base/cpu.h"
#include "render/rays/tile.h"
#include "render/scene/scene.h"
#include "render/shading/environment_light.h"
#include "render/shading/pbr_kernel.h"
#include "render/shading/pbr_shading.h"
#include "render/shading/shading.h"
#include "render/textures/mip_maps.h"

namespace lenticule::render {

/// RayFootprint is the part of a surface that one ray stands for: the sides of a parallelogram
/// across the ray, in the scene frame.
struct RayFootprint {
  Vec3 across{};
  Vec3 along{};
};

/// MaterialInput is a texture of a material.
struct MaterialInput {
  const MipMaps* maps = nullptr;  ///< null: there is no texture
  int uv_set = 0;
  std::array<double, 6> uv_map{};

  [[nodiscard]] bool has_coordinates_of(const MaterialInput& other) const {
    return uv_set == other.uv_set && uv_map == other.uv_map;
  }
};

struct MaterialInputs {
  MaterialInput base_colour, metallic_roughness, normal, occlusion, emission, specular,
      specular_colour, clearcoat, clearcoat_roughness, clearcoat_normal, sheen_colour,
      sheen_roughness, transmission, thickness, iridescence, iridescence_thickness, anisotropy;
};

/// SurfacePlace is a position on a surface, with the change of barycentric coordinates across the
/// footprint.
struct SurfacePlace {
  const MeshShape* mesh = nullptr;  ///< null: spheres and cones, which have no textures
  uint32_t triangle = 0;
  std::array<uint32_t, 3> corners{};
  Barycentric at{};
  Vec2 across{}, along{};
  Vec3 normal{};      ///< shading normal, on the front
  double bend = 0.0;  ///< square of the angle by which the normal changes across the footprint
};

/// Returns the square of alpha of normals that have a mean vector of this length.
[[nodiscard]] double spread_of_normals(double mean_length);

/// Finds the place of a surface that a ray met.
[[nodiscard]] SurfacePlace place_of(const Scene& scene, const Surface& surface, Vec3 direction,
                                    const RayFootprint& footprint);

/// InputReader looks up the textures of a material at one place. Lifetime: must not outlive the
/// scene and the place.
class InputReader {
 public:
  InputReader(const Scene& scene, const SurfacePlace& place) : scene_(scene), place_(place) {}

  /// Returns nothing if there is no texture or the mesh has no texture coordinates.
  [[nodiscard]] std::optional<MipMaps::Value> value(const MaterialInput& input);
  /// Returns a factor times a channel of a texture; the texture is not looked up if the factor
  /// is 0.
  [[nodiscard]] double scaled(double factor, const MaterialInput& input, size_t channel);
  /// Does the same for colours.
  [[nodiscard]] Vec3 tinted(Vec3 factor, const MaterialInput& input);
  /// Returns the base colour, and the alpha that the alpha mode makes of it.
  [[nodiscard]] MipMaps::Value base(const PbrMaterial& material, const MaterialInput& input);

  /// Unit vectors along the texture's axes, perpendicular to the normal, on the front.
  struct TangentFrame {
    Vec3 tangent, bitangent;
  };
  [[nodiscard]] TangentFrame tangents(const MaterialInput& input) const;
  /// Returns the mean vector of a normal map in the scene frame, on the front.
  [[nodiscard]] Vec3 mapped_normal(const MaterialInput& input, double scale);
  /// Sets what factors and textures say about the base and its mirror, all but the normal. Returns
  /// the mean vector of the normal map.
  [[nodiscard]] Vec3 read_mirror(const PbrMaterial& material, const MaterialInputs& inputs,
                                 PbrPoint& out);

 private:
  [[nodiscard]] bool find_coordinates(const MaterialInput& input);

  const Scene& scene_;
  const SurfacePlace& place_;
  // The last look-up: the textures of a material mostly share coordinates, and some are the same.
  const MaterialInput* located_ = nullptr;  ///< input whose coordinates are found
  Vec2 at_{};
  TextureFootprint footprint_{};
  TextureLookup lookup_;                 ///< texels at these coordinates, if its shape has a width
  const MaterialInput* read_ = nullptr;  ///< input whose value is `value_`
  MipMaps::Value value_{};
};

/// Returns the kernel for `isa`, which the machine must support (base/cpu.h).
[[nodiscard]] const pbr_kernel::Kernel& pbr_kernel_for(Isa isa);

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
  PbrScene(const PbrScene&) = delete;
  PbrScene& operator=(const PbrScene&) = delete;

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
  [[nodiscard]] const pbr_kernel::Tables& tables() const { return tables_; }
  [[nodiscard]] pbr_kernel::Beam beam(const BeamSize& size) const;
  /// Returns false if the kernel cannot shade any of the scene's materials.
  [[nodiscard]] bool any_plain() const { return any_plain_; }
  [[nodiscard]] const Affine& panel_from_scene() const { return panel_from_scene_; }

  /// Lights with an intensity of 1; see Scene::lights for their colours.
  [[nodiscard]] const std::vector<SceneLight>& unit_lights() const { return unit_lights_; }

 private:
  [[nodiscard]] MaterialInput input(const TextureUse& use, MipMaps::Content content);
  [[nodiscard]] const MaterialInputs& inputs_of(const Surface& surface) const {
    return inputs_[static_cast<size_t>(surface.material - scene_.materials.data())];
  }
  void set_environment(bool has_studio);
  void set_tables();

  const Scene& scene_;
  std::vector<std::shared_ptr<const MipMaps>> maps_;
  std::vector<MaterialInputs> inputs_;  ///< by material
  std::shared_ptr<const EnvironmentLight> environment_;
  PbrShader::Frame frame_;
  ToneMap tone_map_;
  Affine panel_from_scene_;
  bool any_passes_ = false;
  std::vector<pbr_kernel::Material> materials_;
  pbr_kernel::Tables tables_{};
  pbr_kernel::Beam axes_{};  ///< without sizes
  bool any_plain_ = false;
  std::vector<SceneLight> unit_lights_;
};

/// Returns the metallic-roughness material that is most like a Whitted one.
[[nodiscard]] PbrMaterial pbr_like(const Material& material);

}  // namespace lenticule::render
