// SPDX-License-Identifier: Apache-2.0
#include "render/shading/pbr_inputs.h"

#include <algorithm>
#include <cmath>

namespace lenticule::render {
namespace {

/// Smallest cosine between ray and surface normal for which footprints are projected exactly.
constexpr double kGrazing = 0.02;

Vec3 colour_of(const MipMaps::Value& value) {
  return {value[0], value[1], value[2]};
}

double clamped01(double v) {
  return std::clamp(v, 0.0, 1.0);
}

Vec3 perpendicular(Vec3 unit) {
  return normalized(cross(unit, std::abs(unit.x) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
}

/// Returns the side of a footprint on the plane with that normal, as the ray sees it.
Vec3 on_plane(Vec3 side, Vec3 normal, Vec3 direction) {
  double cosine = dot(normal, direction);
  if (std::abs(cosine) < kGrazing) cosine = cosine < 0.0 ? -kGrazing : kGrazing;
  return side - direction * (dot(side, normal) / cosine);
}

template <class T, size_t N>
std::array<double, N> blended(const std::vector<std::array<T, N>>& values,
                              const std::array<uint32_t, 3>& corners, Barycentric at) {
  std::array<double, N> out;
  for (size_t k = 0; k < N; ++k)
    out[k] = (1.0 - at.u - at.v) * double{values[corners[0]][k]} +
             at.u * double{values[corners[1]][k]} + at.v * double{values[corners[2]][k]};
  return out;
}

const std::vector<std::array<float, 2>>& uvs_of(const MeshShape& mesh, int set) {
  return set == 1 ? mesh.uvs2 : mesh.uvs;
}

/// Returns the change of texture coordinates along the edges of a triangle.
struct TextureEdges {
  Vec2 edge1, edge2;
};
TextureEdges texture_edges(const std::vector<std::array<float, 2>>& uvs,
                           const std::array<uint32_t, 3>& corners,
                           const std::array<double, 6>& map) {
  const auto edge = [&](uint32_t to) {
    const double u = double{uvs[to][0]} - double{uvs[corners[0]][0]};
    const double v = double{uvs[to][1]} - double{uvs[corners[0]][1]};
    return Vec2{map[0] * u + map[1] * v, map[3] * u + map[4] * v};
  };
  return {edge(corners[1]), edge(corners[2])};
}

}  // namespace

/// Toksvig, "Mipmapping Normal Maps", 2005; the concentration is that of a von Mises-Fisher
/// distribution.
double spread_of_normals(double mean_length) {
  const double r = std::clamp(mean_length, 0.1, 1.0);
  return 2.0 * (1.0 - r * r) / (r * (3.0 - r * r));
}

SurfacePlace place_of(const Scene& scene, const Surface& surface, Vec3 direction,
                      const RayFootprint& footprint) {
  SurfacePlace place;
  place.normal = surface.outer_side ? surface.shading_normal : -surface.shading_normal;
  const Vec3 across = on_plane(footprint.across, surface.geometric_normal, direction);
  const Vec3 along = on_plane(footprint.along, surface.geometric_normal, direction);
  if (surface.mesh == nullptr) {
    place.bend = (dot(across, across) + dot(along, along)) * surface.curvature * surface.curvature;
    return place;
  }
  const MeshShape& mesh = *surface.mesh;
  place.mesh = &mesh;
  place.triangle = surface.triangle;
  place.corners = mesh.triangles[surface.triangle];
  place.at = surface.at;
  const std::array<Vec3, 3> corner = corners_of(scene, mesh, surface.triangle);
  const Vec3 edge1 = corner[1] - corner[0], edge2 = corner[2] - corner[0];
  const Vec3 normal = cross(edge1, edge2);
  const double area = dot(normal, normal);
  if (!(area > 0.0)) return place;
  const auto barycentric = [&](Vec3 side) {
    return Vec2{dot(cross(side, edge2), normal) / area, dot(cross(edge1, side), normal) / area};
  };
  place.across = barycentric(across);
  place.along = barycentric(along);
  if (mesh.normals.empty()) return place;
  const Vec3 first(mesh.normals[place.corners[0]]);
  const Vec3 by_u = Vec3(mesh.normals[place.corners[1]]) - first;
  const Vec3 by_v = Vec3(mesh.normals[place.corners[2]]) - first;
  for (const Vec2 side : {place.across, place.along}) {
    const Vec3 change = by_u * side.x + by_v * side.y;
    place.bend += dot(change, change);
  }
  return place;
}

bool InputReader::find_coordinates(const MaterialInput& input) {
  if (located_ != nullptr && located_->has_coordinates_of(input)) return true;
  const auto& uvs = uvs_of(*place_.mesh, input.uv_set);
  if (uvs.empty()) return false;
  const auto [u, v] = blended(uvs, place_.corners, place_.at);
  const auto& map = input.uv_map;
  const TextureEdges edges = texture_edges(uvs, place_.corners, map);
  const auto side = [&](Vec2 by) { return edges.edge1 * by.x + edges.edge2 * by.y; };
  at_ = {map[0] * u + map[1] * v + map[2], map[3] * u + map[4] * v + map[5]};
  footprint_ = {.across = side(place_.across), .along = side(place_.along)};
  lookup_.shape = {};
  located_ = &input;
  return true;
}

std::optional<MipMaps::Value> InputReader::value(const MaterialInput& input) {
  if (input.maps == nullptr || place_.mesh == nullptr) return std::nullopt;
  if (read_ != nullptr && read_->maps == input.maps && read_->has_coordinates_of(input))
    return value_;
  if (!find_coordinates(input)) return std::nullopt;
  if (lookup_.shape != input.maps->shape()) input.maps->find(at_, footprint_, lookup_);
  value_ = input.maps->value(lookup_);
  read_ = &input;
  return value_;
}

double InputReader::scaled(double factor, const MaterialInput& input, size_t channel) {
  if (factor == 0.0) return factor;
  const auto texel = value(input);
  return texel ? factor * (*texel)[channel] : factor;
}

Vec3 InputReader::tinted(Vec3 factor, const MaterialInput& input) {
  if (factor == Vec3{}) return factor;
  const auto texel = value(input);
  return texel ? factor * colour_of(*texel) : factor;
}

/// Vertex tangents where there are some, otherwise the directions in which the texture's u grows
/// and its v falls (v points down, the bitangent up).
InputReader::TangentFrame InputReader::tangents(const MaterialInput& input) const {
  const Vec3 normal = place_.normal;
  const auto upright = [normal](Vec3 tangent, double sign) -> TangentFrame {
    const Vec3 flat = tangent - normal * dot(tangent, normal);
    const Vec3 unit = length(flat) > 1e-9 ? normalized(flat) : perpendicular(normal);
    return {unit, cross(normal, unit) * sign};
  };
  if (place_.mesh == nullptr) return upright({}, 1.0);
  if (!place_.mesh->tangents.empty()) {
    const auto [x, y, z, sign] = blended(place_.mesh->tangents, place_.corners, place_.at);
    return upright(normalized(Vec3{x, y, z}), sign < 0.0 ? -1.0 : 1.0);
  }
  const auto& uvs = uvs_of(*place_.mesh, input.uv_set);
  if (uvs.empty()) return upright({}, 1.0);
  const std::array<double, 6> same{1, 0, 0, 0, 1, 0};
  const TextureEdges edges =
      texture_edges(uvs, place_.corners, input.maps != nullptr ? input.uv_map : same);
  const double area = edges.edge1.x * edges.edge2.y - edges.edge2.x * edges.edge1.y;
  if (area == 0.0) return upright({}, 1.0);
  const std::array<Vec3, 3> corner = corners_of(scene_, *place_.mesh, place_.triangle);
  const Vec3 edge1 = corner[1] - corner[0], edge2 = corner[2] - corner[0];
  const Vec3 by_u = (edge1 * edges.edge2.y - edge2 * edges.edge1.y) / area;
  const Vec3 by_v = (edge2 * edges.edge1.x - edge1 * edges.edge2.x) / area;
  const TangentFrame frame = upright(normalized(by_u), 1.0);
  return dot(frame.bitangent, by_v) > 0.0 ? TangentFrame{frame.tangent, -frame.bitangent} : frame;
}

Vec3 InputReader::mapped_normal(const MaterialInput& input, double scale) {
  const auto texel = value(input);
  if (!texel) return place_.normal;
  const TangentFrame frame = tangents(input);
  const Vec3 mean = colour_of(*texel);
  const Vec3 scaled{mean.x * scale, mean.y * scale, mean.z};
  const Vec3 turned =
      normalized(frame.tangent * scaled.x + frame.bitangent * scaled.y + place_.normal * scaled.z);
  return turned == Vec3{} ? place_.normal : turned * std::min(1.0, length(mean));
}

MipMaps::Value InputReader::base(const PbrMaterial& material, const MaterialInput& input) {
  MipMaps::Value base{material.base_colour.x, material.base_colour.y, material.base_colour.z,
                      material.alpha};
  const auto multiply = [&](const std::array<double, 4>& by) {
    for (size_t c = 0; c < 4; ++c) base[c] *= by[c];
  };
  if (const auto texel = value(input)) multiply(*texel);
  if (place_.mesh != nullptr && !place_.mesh->colours.empty())
    multiply(blended(place_.mesh->colours, place_.corners, place_.at));
  base[3] = material.alpha_mode == PbrMaterial::AlphaMode::Opaque  ? 1.0
            : material.alpha_mode == PbrMaterial::AlphaMode::Blend ? clamped01(base[3])
            : base[3] < material.alpha_cutoff                      ? 0.0
                                                                   : 1.0;
  return base;
}

/// The occlusion comes next to the roughness, since both are often channels of one texture.
MirrorValues InputReader::mirror(const PbrMaterial& material, const MaterialInputs& inputs) {
  MirrorValues out{.metallic = material.metallic, .roughness = material.roughness};
  if (const auto texel = value(inputs.metallic_roughness)) {
    out.roughness *= (*texel)[1];
    out.metallic *= (*texel)[2];
  }
  out.metallic = clamped01(out.metallic);
  out.roughness = clamped01(out.roughness);
  if (const auto texel = value(inputs.occlusion))
    out.occlusion = clamped01(1.0 + material.occlusion_strength * ((*texel)[0] - 1.0));
  out.normal = mapped_normal(inputs.normal, material.normal_scale);
  out.emission = tinted(material.emission, inputs.emission);
  out.specular = scaled(material.specular, inputs.specular, 3);
  out.specular_colour = tinted(material.specular_colour, inputs.specular_colour);
  return out;
}

}  // namespace lenticule::render
