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
/// Largest square of alpha that the shape adds.
constexpr double kMostBend = 0.18;

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

Vec3 perpendicular(Vec3 unit) {
  return normalized(cross(unit, std::abs(unit.x) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
}

/// Returns the roughness of a surface whose microfacets vary by `more` (square of alpha) as well.
double rougher(double roughness, double more) {
  const double alpha = roughness * roughness;
  return std::sqrt(std::sqrt(std::min(1.0, alpha * alpha + more)));
}

bool is_volume(const PbrMaterial& material) {
  return material.transmission > 0.0 && material.thickness > 0.0;
}

}  // namespace

PbrScene::PbrScene(const Scene& scene, bool has_studio)
    : scene_(scene),
      tone_map_(scene.backdrop.tone_map),
      panel_from_scene_(scene.scene_from_panel.inverse()) {
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
  tables_ = std::make_unique<const PbrTables>(scene, *environment_, frame_);
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

MaterialInput PbrScene::input(const TextureUse& use, MipMaps::Content content) {
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

Vec3 PbrScene::passed(const Surface& surface) const {
  const PbrMaterial& material = *surface.material->pbr;
  if (material.alpha_mode == PbrMaterial::AlphaMode::Opaque && material.transmission == 0.0)
    return {};
  const MaterialInputs& inputs = inputs_of(surface);
  const SurfacePlace place = place_of(scene_, surface, -surface.geometric_normal, {});
  InputReader reader(scene_, place);
  const MipMaps::Value base = reader.base(material, inputs.base_colour);
  const double through = reader.scaled(material.transmission, inputs.transmission, 0);
  // Light is tinted where it enters a volume.
  const bool leaves = is_volume(material) && !surface.outer_side;
  const Vec3 tint = leaves ? Vec3{1, 1, 1} : colour_of(base);
  return Vec3{1, 1, 1} * (1.0 - base[3]) + tint * (through * base[3]);
}

namespace {

/// Sets the values of the layers above and below the mirror. `bend` is the square of alpha by which
/// the shape varies; `side` is -1 on the inner side.
void set_layers(const PbrMaterial& m, const MaterialInputs& inputs, double bend, double side,
                InputReader& reader, PbrSurface& out) {
  PbrPoint& p = out.point;
  p.clearcoat = reader.scaled(m.clearcoat, inputs.clearcoat, 0);
  if (p.clearcoat > 0.0) {
    const Vec3 coat = reader.mapped_normal(inputs.clearcoat_normal, 1.0);
    p.coat_normal = normalized(coat) * side;
    p.clearcoat_roughness =
        rougher(clamped01(reader.scaled(m.clearcoat_roughness, inputs.clearcoat_roughness, 1)),
                bend + spread_of_normals(length(coat)));
  }
  p.sheen_colour = reader.tinted(m.sheen_colour, inputs.sheen_colour);
  p.sheen_roughness = clamped01(reader.scaled(m.sheen_roughness, inputs.sheen_roughness, 3));
  p.transmission = clamped01(reader.scaled(m.transmission, inputs.transmission, 0));
  out.thickness = p.transmission > 0.0 ? reader.scaled(m.thickness, inputs.thickness, 1) : 0.0;
  p.iridescence = clamped01(reader.scaled(m.iridescence, inputs.iridescence, 0));
  if (p.iridescence > 0.0) {
    const auto texel = reader.value(inputs.iridescence_thickness);
    p.iridescence_ior = m.iridescence_ior;
    p.iridescence_nm =
        m.iridescence_thickness_min +
        (m.iridescence_thickness_max - m.iridescence_thickness_min) * (texel ? (*texel)[1] : 1.0);
  }
}

void set_anisotropy(const PbrMaterial& m, const MaterialInputs& inputs, InputReader& reader,
                    PbrPoint& p) {
  if (m.anisotropy == 0.0) {
    p.tangent = perpendicular(p.normal);
    return;
  }
  Vec2 way{std::cos(m.anisotropy_rotation), std::sin(m.anisotropy_rotation)};
  p.anisotropy = m.anisotropy;
  if (const auto texel = reader.value(inputs.anisotropy)) {
    const double x = 2.0 * (*texel)[0] - 1.0, y = 2.0 * (*texel)[1] - 1.0;
    way = {way.x * x - way.y * y, way.y * x + way.x * y};
    p.anisotropy *= (*texel)[2];
  }
  p.anisotropy = clamped01(p.anisotropy);
  const InputReader::TangentFrame frame = reader.tangents(inputs.anisotropy);
  const Vec3 stretched = frame.tangent * way.x + frame.bitangent * way.y;
  const Vec3 flat = stretched - p.normal * dot(stretched, p.normal);
  p.tangent = length(flat) > 1e-9 ? normalized(flat) : perpendicular(p.normal);
}

}  // namespace

PbrSurface PbrScene::surface(const Surface& at, Vec3 direction,
                             const RayFootprint& footprint) const {
  const PbrMaterial& m = *at.material->pbr;
  const MaterialInputs& inputs = inputs_of(at);
  const SurfacePlace place = place_of(scene_, at, direction, footprint);
  InputReader reader(scene_, place);
  const double side = at.outer_side ? 1.0 : -1.0;
  PbrSurface out{.material = &m};
  PbrPoint& p = out.point;
  const MipMaps::Value base = reader.base(m, inputs.base_colour);
  p.colour = colour_of(base);
  p.alpha = base[3];
  p.view = -direction;
  p.geometric = at.geometric_normal;
  if (m.unlit || p.alpha == 0.0) return out;
  const MirrorValues mirror = reader.mirror(m, inputs);
  const double bend = std::min(place.bend / kPi, kMostBend);
  p.normal = normalized(mirror.normal) * side;
  p.metallic = mirror.metallic;
  p.roughness = rougher(mirror.roughness, bend + spread_of_normals(length(mirror.normal)));
  p.occlusion = mirror.occlusion;
  p.emission = mirror.emission;
  p.ior = m.ior;
  p.specular = mirror.specular;
  p.specular_colour = mirror.specular_colour;
  p.coat_normal = place.normal * side;
  set_layers(m, inputs, bend, side, reader, out);
  set_anisotropy(m, inputs, reader, p);
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
