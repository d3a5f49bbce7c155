// SPDX-License-Identifier: Apache-2.0
#include "render/shading/pbr_scene.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numbers>
#include <utility>

#include "render/scene/studio_light.h"
#include "render/scene/texture.h"

namespace lenticule::render {
namespace {

constexpr double kPi = std::numbers::pi;
/// Smallest cosine between ray and surface normal for which footprints are projected exactly.
constexpr double kGrazing = 0.02;

/// Keeps filtered textures from frame to frame of an animation: at most those of the textures that
/// are in use somewhere.
std::shared_ptr<const MipMaps> mip_maps_of(const std::shared_ptr<const Texture>& texture,
                                           MipMaps::Content content) {
  static std::mutex adding;
  static std::vector<std::shared_ptr<const MipMaps>> known;
  const std::lock_guard lock(adding);
  const auto is_same = [&](const auto& maps) {
    return &maps->texture() == texture.get() && maps->content() == content;
  };
  const auto found = std::ranges::find_if(known, is_same);
  if (found != known.end()) return *found;
  const auto is_orphan = [](const auto& maps) {
    const auto same = std::ranges::count_if(
        known, [&](const auto& other) { return &other->texture() == &maps->texture(); });
    return maps.use_count() == 1 && maps->owners() == same;
  };
  // One at a time, since two of them may have the same texture.
  for (auto old = std::ranges::find_if(known, is_orphan); old != known.end();
       old = std::ranges::find_if(known, is_orphan))
    known.erase(old);
  return known.emplace_back(std::make_shared<const MipMaps>(texture, content));
}

/// Returns the filtered light of a picture. The last one is kept for the next frame.
std::shared_ptr<const EnvironmentLight> light_of(const std::shared_ptr<const Texture>& picture) {
  static std::mutex making;
  static std::shared_ptr<const Texture> last_picture;
  static std::shared_ptr<const EnvironmentLight> last;
  const std::lock_guard lock(making);
  if (last && same_texture(last_picture, picture)) return last;
  const auto maps = std::make_shared<const MipMaps>(picture, MipMaps::Content::Data);
  last = std::make_shared<const EnvironmentLight>([maps](Vec3 direction, double angle) {
    const double across =
        angle / std::max(0.02, std::sqrt(std::max(0.0, 1.0 - direction.y * direction.y)));
    const MipMaps::Value value =
        maps->value({0.5 + std::atan2(direction.x, -direction.z) / (2.0 * kPi),
                     std::acos(std::clamp(direction.y, -1.0, 1.0)) / kPi},
                    {.across = {across / (2.0 * kPi), 0.0}, .along = {0.0, angle / kPi}});
    return Vec3{value[0], value[1], value[2]};
  });
  last_picture = picture;
  return last;
}

const std::shared_ptr<const EnvironmentLight>& studio() {
  static const auto light = std::make_shared<const EnvironmentLight>([](Vec3 direction, double) {
    return Vec3{1, 1, 1} * studio_light(direction);
  });
  return light;
}

const std::shared_ptr<const EnvironmentLight>& sky() {
  static const auto light = std::make_shared<const EnvironmentLight>(
      [](Vec3 direction, double) { return sky_colour(direction.y); });
  return light;
}

Vec3 colour_of(const MipMaps::Value& value) {
  return {value[0], value[1], value[2]};
}

double clamped01(double v) {
  return std::clamp(v, 0.0, 1.0);
}

/// Returns the side of a footprint on the plane with that normal, as the ray sees it.
Vec3 on_plane(Vec3 side, Vec3 normal, Vec3 direction) {
  double cosine = dot(normal, direction);
  if (std::abs(cosine) < kGrazing) cosine = cosine < 0.0 ? -kGrazing : kGrazing;
  return side - direction * (dot(side, normal) / cosine);
}

Vec3 perpendicular(Vec3 unit) {
  return normalized(cross(unit, std::abs(unit.x) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
}

/// Returns the roughness of a surface whose microfacets vary by `more` (square of alpha) as well.
double rougher(double roughness, double more) {
  const double alpha = roughness * roughness;
  return std::sqrt(std::sqrt(std::min(1.0, alpha * alpha + more)));
}

/// Returns the square of alpha of normals that have a mean vector of this length (Toksvig,
/// "Mipmapping Normal Maps", 2005; the concentration is that of a von Mises-Fisher distribution).
double spread_of_normals(double mean_length) {
  const double r = std::clamp(mean_length, 0.1, 1.0);
  return 2.0 * (1.0 - r * r) / (r * (3.0 - r * r));
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

bool is_volume(const PbrMaterial& material) {
  return material.transmission > 0.0 && material.thickness > 0.0;
}

}  // namespace

PbrScene::PbrScene(const Scene& scene, bool has_studio)
    : scene_(scene), tone_map_(scene.backdrop.tone_map) {
  set_environment(has_studio);
  using enum MipMaps::Content;
  for (const Material& material : scene.materials) {
    const PbrMaterial& m = *material.pbr;
    any_passes_ =
        any_passes_ || m.alpha_mode != PbrMaterial::AlphaMode::Opaque || m.transmission > 0.0;
    inputs_.push_back({.base_colour = input(m.base_colour_texture, Colour),
                       .metallic_roughness = input(m.metallic_roughness_texture, Data),
                       .normal = input(m.normal_texture, Normals),
                       .occlusion = input(m.occlusion_texture, Data),
                       .emission = input(m.emission_texture, Colour),
                       .specular = input(m.specular_texture, Data),
                       .specular_colour = input(m.specular_colour_texture, Colour),
                       .clearcoat = input(m.clearcoat_texture, Data),
                       .clearcoat_roughness = input(m.clearcoat_roughness_texture, Data),
                       .clearcoat_normal = input(m.clearcoat_normal_texture, Normals),
                       .sheen_colour = input(m.sheen_colour_texture, Colour),
                       .sheen_roughness = input(m.sheen_roughness_texture, Data),
                       .transmission = input(m.transmission_texture, Data),
                       .thickness = input(m.thickness_texture, Data),
                       .iridescence = input(m.iridescence_texture, Data),
                       .iridescence_thickness = input(m.iridescence_thickness_texture, Data),
                       .anisotropy = input(m.anisotropy_texture, Data)});
  }
  for (SceneLight light : scene.lights) {
    light.colour = {1, 1, 1};
    unit_lights_.push_back(light);
  }
}

void PbrScene::set_environment(bool has_studio) {
  const Backdrop& backdrop = scene_.backdrop;
  frame_ = {
      .right = cross(backdrop.ahead, backdrop.up), .up = backdrop.up, .back = -backdrop.ahead};
  if (backdrop.environment)
    environment_ = light_of(backdrop.environment);
  else if (backdrop.sky)
    environment_ = sky();
  else if (has_studio)
    environment_ = studio();
  else
    environment_ = std::make_shared<const EnvironmentLight>(scene_.ambient);
}

PbrScene::Input PbrScene::input(const TextureUse& use, MipMaps::Content content) {
  if (use.texture < 0) return {};
  const auto& maps =
      maps_.emplace_back(mip_maps_of(scene_.textures[static_cast<size_t>(use.texture)], content));
  return {.maps = maps.get(), .uv_set = use.uv_set, .uv_map = use.uv_map};
}

Vec3 PbrScene::backdrop(Vec3 origin, Vec3 direction, double roughness) const {
  const Backdrop& backdrop = scene_.backdrop;
  if (backdrop.flat()) return backdrop.colour;
  if (backdrop.ground_shadow)
    return backdrop.colour * backdrop.ground_shadow->light_left(origin, direction);
  if (backdrop.environment && roughness > 0.0)
    return tone_mapped(tone_map_,
                       environment_->mirrored(normalized(frame_.from_scene(direction)), roughness));
  return {backdrop_light(backdrop, direction, 0), backdrop_light(backdrop, direction, 1),
          backdrop_light(backdrop, direction, 2)};
}

PbrScene::Place PbrScene::place_of(const Scene& scene, const Surface& surface, Vec3 direction,
                                   const RayFootprint& footprint) {
  Place place;
  place.normal = surface.outer_side ? surface.shading_normal : -surface.shading_normal;
  const Vec3 across = on_plane(footprint.across, surface.geometric_normal, direction);
  const Vec3 along = on_plane(footprint.along, surface.geometric_normal, direction);
  if (surface.mesh == nullptr) {
    place.bend = (dot(across, across) + dot(along, along)) * surface.curvature * surface.curvature;
    return place;
  }
  const MeshShape& mesh = *surface.mesh;
  place.mesh = &mesh;
  place.corners = mesh.triangles[surface.triangle];
  place.at = surface.at;
  const std::array<Vec3, 3> corner = corners_of(scene, mesh, surface.triangle);
  place.edge1 = corner[1] - corner[0];
  place.edge2 = corner[2] - corner[0];
  const Vec3 normal = cross(place.edge1, place.edge2);
  const double area = dot(normal, normal);
  if (!(area > 0.0)) return place;
  const auto barycentric = [&](Vec3 side) {
    return Vec2{dot(cross(side, place.edge2), normal) / area,
                dot(cross(place.edge1, side), normal) / area};
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

namespace {

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

std::optional<MipMaps::Value> PbrScene::value(const Input& input, const Place& place) {
  if (input.maps == nullptr || place.mesh == nullptr) return std::nullopt;
  const auto& uvs = uvs_of(*place.mesh, input.uv_set);
  if (uvs.empty()) return std::nullopt;
  const auto [u, v] = blended(uvs, place.corners, place.at);
  const auto& map = input.uv_map;
  const TextureEdges edges = texture_edges(uvs, place.corners, map);
  const auto side = [&](Vec2 by) { return edges.edge1 * by.x + edges.edge2 * by.y; };
  return input.maps->value({map[0] * u + map[1] * v + map[2], map[3] * u + map[4] * v + map[5]},
                           {.across = side(place.across), .along = side(place.along)});
}

/// Vertex tangents where there are some, otherwise the directions in which the texture's u grows
/// and its v falls (v points down, the bitangent up).
PbrScene::TangentFrame PbrScene::tangents(const Input& input, const Place& place) {
  const auto upright = [&](Vec3 tangent, double sign) -> TangentFrame {
    const Vec3 flat = tangent - place.normal * dot(tangent, place.normal);
    const Vec3 unit = length(flat) > 1e-9 ? normalized(flat) : perpendicular(place.normal);
    return {unit, cross(place.normal, unit) * sign};
  };
  if (place.mesh == nullptr) return upright({}, 1.0);
  if (!place.mesh->tangents.empty()) {
    const auto [x, y, z, sign] = blended(place.mesh->tangents, place.corners, place.at);
    return upright(normalized(Vec3{x, y, z}), sign < 0.0 ? -1.0 : 1.0);
  }
  const auto& uvs = uvs_of(*place.mesh, input.uv_set);
  if (uvs.empty()) return upright({}, 1.0);
  const std::array<double, 6> same{1, 0, 0, 0, 1, 0};
  const TextureEdges edges =
      texture_edges(uvs, place.corners, input.maps != nullptr ? input.uv_map : same);
  const double area = edges.edge1.x * edges.edge2.y - edges.edge2.x * edges.edge1.y;
  if (area == 0.0) return upright({}, 1.0);
  const Vec3 by_u = (place.edge1 * edges.edge2.y - place.edge2 * edges.edge1.y) / area;
  const Vec3 by_v = (place.edge2 * edges.edge1.x - place.edge1 * edges.edge2.x) / area;
  const TangentFrame frame = upright(normalized(by_u), 1.0);
  return dot(frame.bitangent, by_v) > 0.0 ? TangentFrame{frame.tangent, -frame.bitangent} : frame;
}

Vec3 PbrScene::mapped_normal(const Input& input, double scale, const Place& place) {
  const auto texel = value(input, place);
  if (!texel) return place.normal;
  const TangentFrame frame = tangents(input, place);
  const Vec3 mean = colour_of(*texel);
  const Vec3 scaled{mean.x * scale, mean.y * scale, mean.z};
  const Vec3 turned =
      normalized(frame.tangent * scaled.x + frame.bitangent * scaled.y + place.normal * scaled.z);
  return turned == Vec3{} ? place.normal : turned * std::min(1.0, length(mean));
}

MipMaps::Value PbrScene::base_of(const PbrMaterial& material, const Input& input,
                                 const Place& place) {
  MipMaps::Value base{material.base_colour.x, material.base_colour.y, material.base_colour.z,
                      material.alpha};
  const auto multiply = [&](const std::array<double, 4>& by) {
    for (size_t c = 0; c < 4; ++c) base[c] *= by[c];
  };
  if (const auto texel = value(input, place)) multiply(*texel);
  if (place.mesh != nullptr && !place.mesh->colours.empty())
    multiply(blended(place.mesh->colours, place.corners, place.at));
  base[3] = material.alpha_mode == PbrMaterial::AlphaMode::Opaque  ? 1.0
            : material.alpha_mode == PbrMaterial::AlphaMode::Blend ? clamped01(base[3])
            : base[3] < material.alpha_cutoff                      ? 0.0
                                                                   : 1.0;
  return base;
}

Vec3 PbrScene::passed(const Surface& surface) const {
  const PbrMaterial& material = *surface.material->pbr;
  const auto number = static_cast<size_t>(surface.material - scene_.materials.data());
  if (material.alpha_mode == PbrMaterial::AlphaMode::Opaque && material.transmission == 0.0)
    return {};
  const MaterialInputs& inputs = inputs_[number];
  const Place place = place_of(scene_, surface, -surface.geometric_normal, {});
  const MipMaps::Value base = base_of(material, inputs.base_colour, place);
  double through = material.transmission;
  if (through > 0.0)
    if (const auto texel = value(inputs.transmission, place)) through *= (*texel)[0];
  // Light is tinted where it enters a volume.
  const bool leaves = is_volume(material) && !surface.outer_side;
  const Vec3 tint = leaves ? Vec3{1, 1, 1} : colour_of(base);
  return Vec3{1, 1, 1} * (1.0 - base[3]) + tint * (through * base[3]);
}

PbrSurface PbrScene::surface(const Surface& at, Vec3 direction,
                             const RayFootprint& footprint) const {
  const PbrMaterial& m = *at.material->pbr;
  const MaterialInputs& inputs =
      inputs_[static_cast<size_t>(at.material - scene_.materials.data())];
  const Place place = place_of(scene_, at, direction, footprint);
  const double side = at.outer_side ? 1.0 : -1.0;
  PbrSurface out{.material = &m};
  PbrPoint& p = out.point;
  const MipMaps::Value base = base_of(m, inputs.base_colour, place);
  p.colour = colour_of(base);
  p.alpha = base[3];
  p.view = -direction;
  p.geometric = at.geometric_normal;
  if (m.unlit || p.alpha == 0.0) return out;

  const auto scaled = [&](double factor, const Input& input, size_t channel) {
    if (factor == 0.0) return factor;
    const auto texel = value(input, place);
    return texel ? factor * (*texel)[channel] : factor;
  };
  const auto tinted = [&](Vec3 factor, const Input& input) {
    if (factor == Vec3{}) return factor;
    const auto texel = value(input, place);
    return texel ? factor * colour_of(*texel) : factor;
  };
  p.metallic = m.metallic;
  p.roughness = m.roughness;
  if (const auto texel = value(inputs.metallic_roughness, place)) {
    p.roughness *= (*texel)[1];
    p.metallic *= (*texel)[2];
  }
  p.metallic = clamped01(p.metallic);
  p.roughness = clamped01(p.roughness);
  const double bend = std::min(place.bend / kPi, 0.18);
  const Vec3 mean = mapped_normal(inputs.normal, m.normal_scale, place);
  p.normal = normalized(mean) * side;
  p.roughness = rougher(p.roughness, bend + spread_of_normals(length(mean)));
  if (const auto texel = value(inputs.occlusion, place))
    p.occlusion = clamped01(1.0 + m.occlusion_strength * ((*texel)[0] - 1.0));
  p.emission = tinted(m.emission, inputs.emission);
  p.ior = m.ior;
  p.specular = scaled(m.specular, inputs.specular, 3);
  p.specular_colour = tinted(m.specular_colour, inputs.specular_colour);
  p.clearcoat = scaled(m.clearcoat, inputs.clearcoat, 0);
  p.coat_normal = place.normal * side;
  if (p.clearcoat > 0.0) {
    const Vec3 coat = mapped_normal(inputs.clearcoat_normal, 1.0, place);
    p.coat_normal = normalized(coat) * side;
    p.clearcoat_roughness =
        rougher(clamped01(scaled(m.clearcoat_roughness, inputs.clearcoat_roughness, 1)),
                bend + spread_of_normals(length(coat)));
  }
  p.sheen_colour = tinted(m.sheen_colour, inputs.sheen_colour);
  p.sheen_roughness = clamped01(scaled(m.sheen_roughness, inputs.sheen_roughness, 3));
  p.transmission = clamped01(scaled(m.transmission, inputs.transmission, 0));
  out.thickness = p.transmission > 0.0 ? scaled(m.thickness, inputs.thickness, 1) : 0.0;
  p.iridescence = clamped01(scaled(m.iridescence, inputs.iridescence, 0));
  if (p.iridescence > 0.0) {
    const auto texel = value(inputs.iridescence_thickness, place);
    p.iridescence_ior = m.iridescence_ior;
    p.iridescence_nm =
        m.iridescence_thickness_min +
        (m.iridescence_thickness_max - m.iridescence_thickness_min) * (texel ? (*texel)[1] : 1.0);
  }
  if (m.anisotropy == 0.0) {
    p.tangent = perpendicular(p.normal);
    return out;
  }
  Vec2 way{std::cos(m.anisotropy_rotation), std::sin(m.anisotropy_rotation)};
  p.anisotropy = m.anisotropy;
  if (const auto texel = value(inputs.anisotropy, place)) {
    const double x = 2.0 * (*texel)[0] - 1.0, y = 2.0 * (*texel)[1] - 1.0;
    way = {way.x * x - way.y * y, way.y * x + way.x * y};
    p.anisotropy *= (*texel)[2];
  }
  p.anisotropy = clamped01(p.anisotropy);
  const TangentFrame frame = tangents(inputs.anisotropy, place);
  const Vec3 stretched = frame.tangent * way.x + frame.bitangent * way.y;
  const Vec3 flat = stretched - p.normal * dot(stretched, p.normal);
  p.tangent = length(flat) > 1e-9 ? normalized(flat) : perpendicular(p.normal);
  return out;
}

PbrMaterial pbr_like(const Material& material) {
  PbrMaterial pbr;
  pbr.base_colour = material.colour;
  pbr.base_colour_texture.texture = material.texture;
  // Microfacets with about the highlight of this exponent.
  pbr.roughness = std::clamp(std::pow(2.0 / (std::max(material.shine, 0.0) + 2.0), 0.25), 0.0, 1.0);
  pbr.metallic = material.tinted_specular ? clamped01(material.specular) : 0.0;
  pbr.specular = material.specular > 0.0 ? 1.0 : 0.0;
  pbr.emission = material.emission;
  pbr.transmission = clamped01(material.transmittance);
  pbr.ior = material.refraction_index;
  pbr.thickness = material.refraction_index == 1.0 ? 0.0 : 1.0;
  pbr.double_sided = true;
  return pbr;
}

}  // namespace lenticule::render
