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
#include "optics/vec.h"
#include "render/rays/primary_rays.h"
#include "render/scene/scene.h"
#include "render/shading/environment_light.h"
#include "render/shading/pbr_kernel.h"
#include "render/shading/shading.h"
#include "render/textures/mip_maps.h"

namespace lenticule::render {

// Metallic-roughness shading of a point, in three channels, and the reflectance functions of the
// model; docs/render/shading.md states the formulas. `alpha` is the square of the roughness.
// Cosines are those to the shading normal.

/// Directions in the frame of a surface: x along its tangent, y along its bitangent, z along its
/// normal.
using LocalVec = Vec3;

/// Returns the density of GGX microfacets with the normal `half`. The roughness along the tangent
/// differs from that along the bitangent if the surface is anisotropic.
[[nodiscard]] double ggx_distribution(LocalVec half, double alpha_t, double alpha_b);
/// Returns Smith's height-correlated shadowing and masking, divided by 4 (n . v) (n . l).
[[nodiscard]] double smith_visibility(LocalVec view, LocalVec light, double alpha_t,
                                      double alpha_b);
/// Returns the reflectance of a dielectric at normal incidence, with glTF's `specular` factors.
[[nodiscard]] Vec3 dielectric_f0(double ior, double specular, Vec3 specular_colour);
/// Returns Schlick's approximation of the Fresnel reflectance.
[[nodiscard]] Vec3 schlick(Vec3 f0, Vec3 f90, double cosine);

/// The directional albedo of the GGX lobe: all light that a surface reflects toward a viewer under
/// uniform light is f0 * scale + f90 * bias.
struct GgxAlbedo {
  double scale = 1.0;
  double bias = 0.0;
};
/// Looks up the albedo in a table, within 0.004 of the integral.
[[nodiscard]] GgxAlbedo ggx_albedo(double view_cosine, double roughness);
/// Returns the same table in single precision.
[[nodiscard]] const pbr_kernel::AlbedoTable& ggx_albedo_table();

/// Returns the density of Charlie's microfacets, which model cloth.
[[nodiscard]] double charlie_distribution(double half_cosine, double alpha);
/// Returns Neubelt's visibility for cloth.
[[nodiscard]] double neubelt_visibility(double view_cosine, double light_cosine);
/// Looks up the directional albedo of white sheen in a table, within 0.01 of the integral, but at
/// most 1: at grazing angles the model itself reflects more light than arrives.
[[nodiscard]] double sheen_albedo(double view_cosine, double roughness);
/// Returns the same table in single precision.
[[nodiscard]] const pbr_kernel::SheenTable& sheen_albedo_table();

/// Returns the reflectance, at normal incidence, of a base with reflectance `base_f0` under a thin
/// film (Belcour and Barla, "A Practical Extension to Microfacet Theory for the Modeling of Varying
/// Iridescence", 2017, as glTF states it).
[[nodiscard]] Vec3 film_f0(double film_ior, double view_cosine, double thickness_nm, Vec3 base_f0);

/// PbrPoint is a point of a surface and what its material's factors and textures say there.
/// Directions are unit and in the scene frame; normals are on the viewer's side.
struct PbrPoint {
  Vec3 view{};       ///< toward the viewer
  Vec3 geometric{};  ///< normal of the primitive
  Vec3 normal{};     ///< normal that the normal map gives
  Vec3 tangent{};    ///< direction of anisotropy; perpendicular to `normal`
  Vec3 coat_normal{};
  Vec3 colour{1, 1, 1};  ///< base colour
  double alpha = 1.0;    ///< share of the light that the surface does not let pass unchanged
  double metallic = 0.0;
  double roughness = 1.0;
  double occlusion = 1.0;  ///< share of the environment that the point sees
  Vec3 emission{};
  double ior = 1.5;
  double specular = 1.0;
  Vec3 specular_colour{1, 1, 1};
  double clearcoat = 0.0;
  double clearcoat_roughness = 0.0;
  Vec3 sheen_colour{};
  double sheen_roughness = 0.0;
  double transmission = 0.0;
  double iridescence = 0.0;
  double iridescence_ior = 1.3;
  double iridescence_nm = 400.0;
  double anisotropy = 0.0;
};

/// PbrShader evaluates one point for lights and the environment.
class PbrShader {
 public:
  explicit PbrShader(const PbrPoint& point);

  /// Returns the share of a light that the surface reflects toward the viewer: pi times the
  /// reflectance function times the cosine. Zero if the light is behind the surface.
  [[nodiscard]] Vec3 of_light(Vec3 toward_light) const;
  /// Returns the light of the environment that the surface reflects toward the viewer. Directions
  /// of the environment are map_from_scene times those of the scene frame.
  struct Frame {
    Vec3 right{1, 0, 0}, up{0, 1, 0}, back{0, 0, 1};
    [[nodiscard]] Vec3 from_scene(Vec3 d) const {
      return {dot(right, d), dot(up, d), dot(back, d)};
    }
  };
  [[nodiscard]] Vec3 of_environment(const EnvironmentLight& light, const Frame& frame) const;
  /// Returns the light that the surface emits.
  [[nodiscard]] Vec3 emitted() const;
  /// Returns the share of the light behind the surface that is transmitted.
  [[nodiscard]] Vec3 transmitted() const;

 private:
  PbrPoint point_;
  Vec3 bitangent_{};
  double view_cosine_ = 1.0;
  LocalVec local_view_{};
  double coat_cosine_ = 1.0;
  double alpha_t_ = 1.0, alpha_b_ = 1.0;
  Vec3 f0_{}, f90_{};
  Vec3 single_{};              ///< albedo of light that is reflected once
  Vec3 multiple_{};            ///< albedo of light that is reflected between microfacets
  Vec3 stronger_{};            ///< (single + multiple) / single
  double below_mirror_ = 1.0;  ///< share of the light that goes through the GGX lobe of dielectrics
  Vec3 diffuse_{};
  double sheen_albedo_ = 0.0;
  double below_sheen_ = 1.0;
  double coat_albedo_ = 0.0;
  double below_coat_ = 1.0;
};

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
inline constexpr size_t kMaterialInputs = sizeof(MaterialInputs) / sizeof(MaterialInput);

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

/// LaneTextures looks up what textures and vertices say at the points of a packet's lanes that are
/// on one mesh. Each texture is looked up once. Thread safety: used by one thread.
class LaneTextures {
 public:
  /// Begins with points of a mesh, or of spheres and cones, which have no textures, if it is null.
  /// Lifetime: the mesh must outlive the following calls.
  void start(const MeshShape* mesh) {
    mesh_ = mesh;
    lanes_ = 0;
    located_ = nullptr;
    count_ = 0;
  }
  void add(size_t lane, const SurfacePlace& place) {
    lanes_ |= 1U << lane;
    places_[lane] = place;
  }
  [[nodiscard]] const SurfacePlace& place(size_t lane) const { return places_[lane]; }
  // Lifetime: results are valid until the next start().

  /// Returns null if there is no texture or the mesh has no texture coordinates.
  [[nodiscard]] const texel_kernel::Values* value(const MaterialInput& input);
  /// Looks up all that pbr_kernel::Kernel::apply() uses.
  [[nodiscard]] const pbr_kernel::Textures& all(const PbrMaterial& material,
                                                const MaterialInputs& inputs);

 private:
  [[nodiscard]] bool find_coordinates(const MaterialInput& input);
  [[nodiscard]] const texel_kernel::Values* of_vertices(
      const std::vector<std::array<float, 4>>& values, texel_kernel::Values& out) const;
  void set_axes(const MaterialInput& input, pbr_kernel::AxesInput& out);

  const MeshShape* mesh_ = nullptr;
  uint32_t lanes_ = 0;
  std::array<SurfacePlace, texel_kernel::kLanes> places_;
  const MaterialInput* located_ = nullptr;  ///< input whose coordinates are in `area_`
  texel_kernel::Area area_{};
  TextureLookup lookup_;
  size_t count_ = 0;  ///< number of textures that were looked up
  std::array<const MaterialInput*, kMaterialInputs> known_{};
  std::array<texel_kernel::Values, kMaterialInputs> values_;
  texel_kernel::Values vertex_colours_, vertex_tangents_;
  pbr_kernel::Textures textures_{};
};

/// InputReader looks up the textures of a material at one place. Lifetime: must not outlive the
/// scene and the place.
class InputReader {
 public:
  /// Takes the texels from lane `lane` of `lanes`, which has the place. If `lanes` is null, looks
  /// them up.
  InputReader(const Scene& scene, const SurfacePlace& place, LaneTextures* lanes, size_t lane)
      : scene_(scene), place_(place), lanes_(lanes), lane_(lane) {}

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
  const Scene& scene_;
  const SurfacePlace& place_;
  LaneTextures* lanes_;
  size_t lane_;
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

  /// Returns a point at a place, whose textures `reader` looks up.
  [[nodiscard]] PbrSurface surface(const Surface& at, Vec3 direction, const SurfacePlace& place,
                                   InputReader& reader) const;
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

}  // namespace lenticule::render
