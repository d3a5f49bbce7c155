// SPDX-License-Identifier: Apache-2.0
// Textures of metallic-roughness materials, and their values at points of surfaces.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "render/scene/scene.h"
#include "render/shading/surface.h"
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

/// MirrorValues is what a material's factors and textures say at a point about its base and its
/// mirror.
struct MirrorValues {
  double metallic = 0.0;
  double roughness = 1.0;
  Vec3 normal{};  ///< mean vector of the normal map in the scene frame, on the front
  double occlusion = 1.0;
  Vec3 emission{};
  double specular = 1.0;
  Vec3 specular_colour{1, 1, 1};
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
  [[nodiscard]] MirrorValues mirror(const PbrMaterial& material, const MaterialInputs& inputs);

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

}  // namespace lenticule::render
