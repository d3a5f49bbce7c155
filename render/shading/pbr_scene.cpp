// SPDX-License-Identifier: Apache-2.0
#include "render/shading/pbr_scene.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numbers>

#include "render/scene/surroundings.h"
#include "render/scene/texture.h"
#include "render/shading/shading_tables.h"

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
Vec3 InputReader::read_mirror(const PbrMaterial& material, const MaterialInputs& inputs,
                              PbrPoint& out) {
  out.metallic = material.metallic;
  out.roughness = material.roughness;
  if (const auto texel = value(inputs.metallic_roughness)) {
    out.roughness *= (*texel)[1];
    out.metallic *= (*texel)[2];
  }
  out.metallic = clamped01(out.metallic);
  out.roughness = clamped01(out.roughness);
  if (const auto texel = value(inputs.occlusion))
    out.occlusion = clamped01(1.0 + material.occlusion_strength * ((*texel)[0] - 1.0));
  const Vec3 normal = mapped_normal(inputs.normal, material.normal_scale);
  out.emission = tinted(material.emission, inputs.emission);
  out.ior = material.ior;
  out.specular = scaled(material.specular, inputs.specular, 3);
  out.specular_colour = tinted(material.specular_colour, inputs.specular_colour);
  return normal;
}

// ---- tables for the kernel

namespace {

void write(Vec3 v, float (&out)[3]) {
  out[0] = static_cast<float>(v.x);
  out[1] = static_cast<float>(v.y);
  out[2] = static_cast<float>(v.z);
}

/// Returns true if the material consists of a base, a mirror and at most a coat.
bool is_plain(const PbrMaterial& m) {
  return !m.unlit && m.transmission == 0.0 && m.sheen_colour == Vec3{} && m.iridescence == 0.0 &&
         m.anisotropy == 0.0;
}

/// Textures also decide where a material is cut out.
bool is_textured(const PbrMaterial& m) {
  const TextureUse* uses[] = {
      &m.base_colour_texture,     &m.metallic_roughness_texture, &m.normal_texture,
      &m.occlusion_texture,       &m.emission_texture,           &m.specular_texture,
      &m.specular_colour_texture, &m.clearcoat_texture,          &m.clearcoat_roughness_texture,
      &m.clearcoat_normal_texture};
  return m.alpha_mode != PbrMaterial::AlphaMode::Opaque ||
         std::ranges::any_of(uses, [](const TextureUse* use) { return use->texture >= 0; });
}

pbr_kernel::Material table_entry(const PbrMaterial& m) {
  pbr_kernel::Material out{};
  write(m.base_colour, out.colour);
  write(m.emission, out.emission);
  out.metallic = static_cast<float>(std::clamp(m.metallic, 0.0, 1.0));
  out.roughness = static_cast<float>(std::clamp(m.roughness, 0.0, 1.0));
  write(dielectric_f0(m.ior, m.specular, m.specular_colour), out.f0);
  out.f90 = static_cast<float>(m.specular);
  out.coat = static_cast<float>(m.clearcoat);
  out.coat_roughness = static_cast<float>(std::clamp(m.clearcoat_roughness, 0.0, 1.0));
  out.is_plain = is_plain(m) ? -1 : 0;
  out.is_two_sided = m.double_sided ? -1 : 0;
  out.is_textured = is_textured(m) ? -1 : 0;
  return out;
}

}  // namespace

void PbrScene::set_tables() {
  for (const Material& material : scene_.materials) {
    materials_.push_back(table_entry(*material.pbr));
    any_plain_ = any_plain_ || materials_.back().is_plain != 0;
  }
  for (const MeshShape& mesh : scene_.meshes)
    if (!mesh.colours.empty()) materials_[static_cast<size_t>(mesh.material)].is_textured = -1;
  tables_ = {.shapes = &scene_.shading->tables(),
             .materials = materials_.data(),
             .environment = environment_->tables(),
             .albedo = &ggx_albedo_table()};
  write(frame_.right, tables_.environment.right);
  write(frame_.up, tables_.environment.up);
  write(frame_.back, tables_.environment.back);

  write(scene_.scene_from_panel.column_x, axes_.across);
  write(scene_.scene_from_panel.column_y, axes_.along);
  const Affine& map = panel_from_scene_;
  write({map.column_x.z, map.column_y.z, map.column_z.z}, axes_.depth);
  axes_.depth_origin = static_cast<float>(map.origin.z);
}

pbr_kernel::Beam PbrScene::beam(const BeamSize& size) const {
  pbr_kernel::Beam beam = axes_;
  beam.lens_mm = static_cast<float>(size.lens_mm);
  beam.row_mm = static_cast<float>(size.row_mm);
  beam.subpixels_per_gap = static_cast<float>(size.subpixels_per_gap);
  beam.inverse_distance = static_cast<float>(size.inverse_distance);
  return beam;
}

const pbr_kernel::Kernel& pbr_kernel_for(Isa isa) {
  return LENTICULE_SELECT_KERNEL(isa, kPbrKernel);
}

// ---- scene

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
  set_tables();
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
  const Vec3 normal = reader.read_mirror(m, inputs, p);
  const double bend = std::min(place.bend / kPi, kMostBend);
  p.normal = normalized(normal) * side;
  p.roughness = rougher(p.roughness, bend + spread_of_normals(length(normal)));
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
