// SPDX-License-Identifier: Apache-2.0
#include "render/scene/surroundings.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "frames/image_io.h"
#include "frames/srgb.h"
#include "render/scene/texture.h"

namespace lenticule::render {
namespace {

// Colours of the sky, in linear light: pale at the horizon, blue overhead, brown below.
constexpr Vec3 kHorizon{0.80, 0.86, 0.92};
constexpr Vec3 kZenith{0.16, 0.32, 0.66};
constexpr Vec3 kEarth{0.22, 0.20, 0.18};

/// Extent of the ground to each side, in multiples of the scene's size.
constexpr double kGroundExtent = 100.0;

double sky_light(Vec3 direction, Vec3 up, int channel) {
  const double height = std::clamp(dot(direction, up), -1.0, 1.0);
  const double horizon = component(kHorizon, channel);
  const double pole = component(height >= 0.0 ? kZenith : kEarth, channel);
  return horizon + (pole - horizon) * std::sqrt(std::abs(height));
}

double environment_light(const Backdrop& backdrop, Vec3 direction, int channel) {
  const Vec3 right = cross(backdrop.ahead, backdrop.up);
  const double azimuth = std::atan2(dot(direction, right), dot(direction, backdrop.ahead));
  const double from_up = std::acos(std::clamp(dot(direction, backdrop.up), -1.0, 1.0));
  const auto value = [&](int of) {
    return texture_value(*backdrop.environment, 0.5 + azimuth / (2.0 * std::numbers::pi),
                         from_up / std::numbers::pi, of);
  };
  if (backdrop.tone_map == ToneMap::None) return value(channel);
  return component(tone_mapped(backdrop.tone_map, {value(0), value(1), value(2)}), channel);
}

std::shared_ptr<const Texture> load_environment(const std::string& file, bool colour_managed) {
  frames::FloatImage image = frames::floats_of(frames::read_texture(file));
  auto texture = std::make_shared<Texture>();
  texture->name = file;
  texture->width = image.width;
  texture->height = image.height;
  texture->rgba = std::move(image.rgba);
  texture->repeat_v = false;
  // A scene without colour management is computed in code values, so the picture is converted to
  // code values.
  if (!colour_managed)
    for (float& value : texture->rgba)
      value = static_cast<float>(frames::srgb_from_linear(double{value}));
  return texture;
}

/// Returns the world axis (with sign) nearest to v.
Vec3 nearest_axis(Vec3 v) {
  const Vec3 size{std::abs(v.x), std::abs(v.y), std::abs(v.z)};
  // Ties go to y, then to z: file formats use one of these two axes as up.
  if (size.y >= size.x && size.y >= size.z) return {0, std::copysign(1.0, v.y), 0};
  if (size.z >= size.x) return {0, 0, std::copysign(1.0, v.z)};
  return {std::copysign(1.0, v.x), 0, 0};
}

}  // namespace

Vec3 sky_colour(double up_cosine) {
  constexpr Vec3 kUp{0, 1, 0};
  const Vec3 direction{0, up_cosine, 0};
  return {sky_light(direction, kUp, 0), sky_light(direction, kUp, 1), sky_light(direction, kUp, 2)};
}

Vec3 world_up(const Stage& stage) {
  return nearest_axis(world_from_canvas(stage).column_y);
}

Backdrop make_backdrop(const SceneDescription& description, const Stage& stage,
                       const Surroundings& surroundings) {
  Backdrop backdrop;
  backdrop.colour = surroundings.background.value_or(description.background);
  backdrop.up = world_up(stage);
  const Affine map = world_from_canvas(stage);
  const Vec3 into_canvas = -map.column_z;
  backdrop.ahead = normalized(into_canvas - backdrop.up * dot(into_canvas, backdrop.up));
  if (backdrop.ahead == Vec3{}) backdrop.ahead = normalized(cross(backdrop.up, map.column_x));
  backdrop.sky = surroundings.sky;
  if (!surroundings.environment_file.empty())
    backdrop.environment =
        load_environment(surroundings.environment_file, description.colour_managed);
  return backdrop;
}

double backdrop_light(const Backdrop& backdrop, Vec3 direction, int channel) {
  if (backdrop.environment) return environment_light(backdrop, direction, channel);
  if (backdrop.sky) return sky_light(direction, backdrop.up, channel);
  return component(backdrop.colour, channel);
}

double light_beyond(const Backdrop& backdrop, Vec3 origin, Vec3 direction, int channel) {
  if (!backdrop.ground_shadow) return backdrop_light(backdrop, normalized(direction), channel);
  return component(backdrop.colour, channel) *
         backdrop.ground_shadow->light_left(origin, direction);
}

TriangleMesh ground_plane(const Bounds& bounds, Vec3 up, int material) {
  const Vec3 size = bounds.high - bounds.low;
  const double reach = kGroundExtent * std::max({size.x, size.y, size.z, 1e-9});
  const Vec3 middle = (bounds.low + bounds.high) * 0.5;
  const double half_height = 0.5 * std::abs(dot(size, up));
  // Slightly below the lowest point, so that the ground does not coincide with a flat base.
  const Vec3 foot = middle - up * (half_height * (1.0 + 1e-4));
  const Vec3 side = up.x != 0.0 ? Vec3{0, 1, 0} : Vec3{1, 0, 0};
  const Vec3 a = side * reach;
  const Vec3 b = cross(up, side) * reach;
  TriangleMesh mesh;
  mesh.name = "ground";
  mesh.material = material;
  mesh.positions = {foot - a - b, foot + a - b, foot + a + b, foot - a + b};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

}  // namespace lenticule::render
