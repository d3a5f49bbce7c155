// SPDX-License-Identifier: Apache-2.0
#include "render/scene/surroundings.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "base/error.h"
#include "frames/image_io.h"
#include "frames/srgb.h"
#include "render/scene/texture.h"

namespace lenticule::render {

GroundShadow::GroundShadow(const GroundGrid& grid, std::vector<float> darkness)
    : grid_(grid),
      column_axis_(grid.across / grid.cell),
      row_axis_(grid.along / grid.cell),
      first_column_(grid.x / grid.cell),
      first_row_(grid.y / grid.cell),
      darkness_(std::move(darkness)) {
  LENTICULE_CHECK(grid.columns > 1 && grid.rows > 1 &&
                  darkness_.size() == static_cast<size_t>(grid.columns) * grid.rows);
}

double GroundShadow::light_at(double column, double row) const {
  const bool inside =
      column >= 0.0 && column < grid_.columns - 1 && row >= 0.0 && row < grid_.rows - 1;
  if (!inside) return 1.0;  // also for NaN
  const auto left = static_cast<size_t>(column), above = static_cast<size_t>(row);
  const double right = column - static_cast<double>(left);
  const double below = row - static_cast<double>(above);
  const auto stride = static_cast<size_t>(grid_.columns);
  const float* first = darkness_.data() + above * stride + left;
  const auto in_row = [right](const float* points) {
    return (1.0 - right) * double{points[0]} + right * double{points[1]};
  };
  return 1.0 - ((1.0 - below) * in_row(first) + below * in_row(first + stride));
}

double GroundShadow::light_left(Vec3 origin, Vec3 direction) const {
  const double falls = -dot(direction, grid_.up);
  if (!(falls > 0.0)) return 1.0;
  const double parameter = (dot(origin, grid_.up) - grid_.height) / falls;
  return light_at(
      dot(origin, column_axis_) - first_column_ + parameter * dot(direction, column_axis_),
      dot(origin, row_axis_) - first_row_ + parameter * dot(direction, row_axis_));
}

void GroundShadow::light_left(const Rays& rays, std::array<double, kRays>& out) const {
  std::array<double, kRays> falls, columns, rows;
  for (size_t r = 0; r < kRays; ++r) {
    const Vec3 origin{double{rays.origin_x[r]}, double{rays.origin_y[r]}, double{rays.origin_z[r]}};
    const Vec3 direction{double{rays.direction_x[r]}, double{rays.direction_y[r]},
                         double{rays.direction_z[r]}};
    falls[r] = -dot(direction, grid_.up);
    const double parameter = (dot(origin, grid_.up) - grid_.height) / falls[r];
    columns[r] =
        dot(origin, column_axis_) - first_column_ + parameter * dot(direction, column_axis_);
    rows[r] = dot(origin, row_axis_) - first_row_ + parameter * dot(direction, row_axis_);
  }
  for (size_t r = 0; r < kRays; ++r) out[r] = falls[r] > 0.0 ? light_at(columns[r], rows[r]) : 1.0;
}

std::array<Vec3, 4> GroundShadow::corners(const Affine& map) const {
  const double right = grid_.columns - 1, below = grid_.rows - 1;
  return {map.point(grid_.point(0, 0)), map.point(grid_.point(right, 0)),
          map.point(grid_.point(right, below)), map.point(grid_.point(0, below))};
}

GroundShadow::Row::Row(const GroundShadow& shadow, const Affine& shadow_from_frame, double y,
                       double tan_y)
    : shadow_(shadow) {
  const Vec3 point = shadow_from_frame.point({0.0, y, 0.0});
  const Vec3 direction = shadow_from_frame.vector({0.0, -tan_y, -1.0});
  const Vec3 x_axis = shadow_from_frame.vector({1.0, 0.0, 0.0});
  const auto of_points = [&](Vec3 axis, double first) {
    return Linear{dot(point, axis) - first, dot(x_axis, axis)};
  };
  const auto of_directions = [&](Vec3 axis) {
    return Linear{dot(direction, axis), -dot(x_axis, axis)};
  };
  const GroundGrid& grid = shadow.grid_;
  height_ = of_points(grid.up, grid.height);
  column_ = of_points(shadow.column_axis_, shadow.first_column_);
  row_ = of_points(shadow.row_axis_, shadow.first_row_);
  falls_ = of_directions(-grid.up);
  column_step_ = of_directions(shadow.column_axis_);
  row_step_ = of_directions(shadow.row_axis_);
}

double GroundShadow::Row::light_left(double x, double tan_x) const {
  const double falls = falls_.at(tan_x);
  if (!(falls > 0.0)) return 1.0;
  const double parameter = height_.at(x) / falls;
  return shadow_.light_at(column_.at(x) + parameter * column_step_.at(tan_x),
                          row_.at(x) + parameter * row_step_.at(tan_x));
}

namespace {

template <class Function>
Vec3 each(Vec3 v, const Function& of) {
  return {of(v.x), of(v.y), of(v.z)};
}

// Khronos PBR Neutral (https://github.com/KhronosGroup/ToneMapping). The darkest channel loses the
// reflection of a dielectric, kFloor; above kStart the brightest channel is compressed.
constexpr double kFloor = 0.04;
constexpr double kStart = 0.8 - kFloor;
constexpr double kDesaturation = 0.15;
constexpr double kRoom = 1.0 - kStart;

Vec3 neutral(Vec3 light) {
  const double low = smallest(light);
  const double floor = low < 2.0 * kFloor ? low - low * low / (4.0 * kFloor) : kFloor;
  const Vec3 lowered = light - Vec3{floor, floor, floor};
  const double peak = largest(lowered);
  if (peak < kStart) return lowered;
  const double shown = 1.0 - kRoom * kRoom / (peak + kRoom - kStart);
  const double kept = 1.0 / (kDesaturation * (peak - shown) + 1.0);
  return lowered * (shown / peak * kept) + Vec3{shown, shown, shown} * (1.0 - kept);
}

// Hill's fit works in its own primaries; the columns of both matrices.
constexpr Affine kAcesIn{
    {0.59719, 0.07600, 0.02840}, {0.35458, 0.90834, 0.13383}, {0.04823, 0.01566, 0.83777}, {}};
constexpr Affine kAcesOut{{1.60475, -0.10208, -0.00327},
                          {-0.53108, 1.10813, -0.07276},
                          {-0.07367, -0.00605, 1.07602},
                          {}};
constexpr double kAcesExposure = 1.0 / 0.6;
// The curve (v^2 + a v - b) / (c v^2 + d v + e).
constexpr double kA = 0.0245786, kB = 0.000090537, kC = 0.983729, kD = 0.4329510, kE = 0.238081;

Vec3 aces(Vec3 light) {
  const Vec3 curved = each(kAcesIn.vector(light * kAcesExposure),
                           [](double v) { return (v * (v + kA) - kB) / (v * (kC * v + kD) + kE); });
  return each(kAcesOut.vector(curved), [](double v) { return std::clamp(v, 0.0, 1.0); });
}

}  // namespace

ToneMap tone_map_named(const std::string& name) {
  if (name == "none") return ToneMap::None;
  if (name == "pbr-neutral") return ToneMap::PbrNeutral;
  if (name == "aces") return ToneMap::Aces;
  throw Error(ErrorKind::Usage, fmt::format("tone map '{}': unknown", name),
              "choose none, pbr-neutral or aces");
}

Vec3 tone_mapped(ToneMap map, Vec3 light) {
  switch (map) {
    case ToneMap::PbrNeutral:
      return neutral(light);
    case ToneMap::Aces:
      return aces(light);
    case ToneMap::None:
      break;
  }
  return light;
}

// ---- studio light

namespace {

/// SoftBox is a rectangle of light on the plane that touches the unit sphere at `towards`. Its
/// edges fade over `edge` on each side.
struct SoftBox {
  Vec3 towards;
  double half_width;
  double half_height;
  double edge;
  double light;
};

constexpr std::array<SoftBox, 5> kBoxes{{
    {{-0.62, 0.45, 0.64}, 0.42, 0.42, 0.12, 5.0},   // key, upper left before the model
    {{0.80, 0.10, 0.60}, 0.22, 0.60, 0.10, 3.5},    // strip, right
    {{0.00, 1.00, 0.00}, 0.80, 0.50, 0.20, 1.6},    // ceiling
    {{0.70, 0.35, -0.62}, 0.30, 0.50, 0.10, 3.0},   // rim, right behind the model
    {{-0.85, 0.10, -0.52}, 0.18, 0.60, 0.10, 3.0},  // rim, left behind the model
}};

constexpr double kFloorLight = 0.60;
constexpr double kCeilingLight = 0.85;
/// Sets the light of a white matt surface that faces the viewer to 1.
constexpr double kExposure = 0.6087;

double smooth_step(double low, double high, double v) {
  const double t = std::clamp((v - low) / (high - low), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

/// PlacedBox is a SoftBox with the axes of its plane.
struct PlacedBox {
  Vec3 towards, right, up;
  SoftBox box;

  explicit PlacedBox(const SoftBox& of) : towards(normalized(of.towards)), box(of) {
    right = normalized(cross(std::abs(towards.y) > 0.99 ? Vec3{0, 0, -1} : Vec3{0, 1, 0}, towards));
    up = cross(towards, right);
  }

  [[nodiscard]] double light(Vec3 direction) const {
    const double along = dot(direction, towards);
    if (along <= 0.0) return 0.0;
    const double x = std::abs(dot(direction, right)), y = std::abs(dot(direction, up));
    if (x >= (box.half_width + box.edge) * along || y >= (box.half_height + box.edge) * along)
      return 0.0;
    return box.light *
           (1.0 - smooth_step(box.half_width - box.edge, box.half_width + box.edge, x / along)) *
           (1.0 - smooth_step(box.half_height - box.edge, box.half_height + box.edge, y / along));
  }
};

}  // namespace

double studio_light(Vec3 direction) {
  double light = kFloorLight + (kCeilingLight - kFloorLight) * smooth_step(-1.0, 1.0, direction.y);
  static const std::vector<PlacedBox> boxes(kBoxes.begin(), kBoxes.end());
  for (const PlacedBox& box : boxes) light += box.light(direction);
  return light * kExposure;
}

// ---- background of the studio

namespace {

/// Luminance of matt surfaces that hardly stand out from the light background, and the share of
/// the area from which on they matter.
constexpr double kBright = 0.65, kMuch = 0.4;
/// Largest number of faces of a mesh whose colours are looked up.
constexpr size_t kMostFaces = 1024;

/// Returns the base colour in the middle of a triangle.
Vec3 base_colour(const SceneDescription& scene, const TriangleMesh& mesh, size_t triangle) {
  const auto& [a, b, c] = mesh.triangles[triangle];
  const auto material = static_cast<size_t>(mesh.material);
  if (material >= scene.materials.size()) return {1, 1, 1};
  const Material& of = scene.materials[material];
  Vec3 colour = of.pbr ? of.pbr->base_colour : of.colour;
  const TextureUse use = of.pbr ? of.pbr->base_colour_texture : TextureUse{.texture = of.texture};
  const auto& uvs = use.uv_set == 0 ? mesh.uvs : mesh.uvs2;
  if (use.texture >= 0 && !uvs.empty()) {
    const double u = double{uvs[a][0] + uvs[b][0] + uvs[c][0]} / 3.0;
    const double v = double{uvs[a][1] + uvs[b][1] + uvs[c][1]} / 3.0;
    const auto& map = use.uv_map;
    const auto light = [&](int channel) {
      return texture_value(*scene.textures[static_cast<size_t>(use.texture)],
                           map[0] * u + map[1] * v + map[2], map[3] * u + map[4] * v + map[5],
                           channel);
    };
    colour = colour * Vec3{light(0), light(1), light(2)};
  }
  if (mesh.colours.empty()) return colour;
  const auto& painted = mesh.colours[a];
  return colour * Vec3{double{painted[0]}, double{painted[1]}, double{painted[2]}};
}

}  // namespace

std::optional<Vec3> studio_background(const SceneDescription& scene) {
  const bool is_pbr =
      scene.lit_by_studio ||
      std::ranges::any_of(scene.materials, [](const Material& m) { return m.pbr != nullptr; });
  // Files that state no background have a black one.
  if (!is_pbr || !scene.lights.empty() || scene.ambient || scene.background != Vec3{})
    return std::nullopt;
  double all = 0.0, bright = 0.0;
  for_each_mesh(scene, [&](const TriangleMesh& mesh) {
    const size_t step = mesh.triangles.size() / kMostFaces + 1;
    for (size_t n = 0; n < mesh.triangles.size(); n += step) {
      const auto& [a, b, c] = mesh.triangles[n];
      const Vec3 ab = mesh.positions[b] - mesh.positions[a];
      const Vec3 ac = mesh.positions[c] - mesh.positions[a];
      const double area = length(cross(ab, ac)) * static_cast<double>(step);
      all += area;
      if (dot(base_colour(scene, mesh, n), {0.2126, 0.7152, 0.0722}) >= kBright) bright += area;
    }
  });
  return bright > kMuch * all ? kDarkStudioBackground : kStudioBackground;
}

// ---- surroundings

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

Vec3 world_up(const Stage& stage) { return nearest_axis(world_from_canvas(stage).column_y); }

Backdrop make_backdrop(const SceneDescription& description, const Stage& stage,
                       const Surroundings& surroundings) {
  Backdrop backdrop;
  backdrop.colour = surroundings.background.value_or(description.background);
  turn_to(stage, backdrop);
  backdrop.sky = surroundings.sky;
  if (!surroundings.environment_file.empty())
    backdrop.environment =
        load_environment(surroundings.environment_file, description.colour_managed);
  return backdrop;
}

void turn_to(const Stage& stage, Backdrop& backdrop) {
  backdrop.up = world_up(stage);
  const Affine map = world_from_canvas(stage);
  const Vec3 into_canvas = -map.column_z;
  backdrop.ahead = normalized(into_canvas - backdrop.up * dot(into_canvas, backdrop.up));
  if (backdrop.ahead == Vec3{}) backdrop.ahead = normalized(cross(backdrop.up, map.column_x));
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

TriangleMesh ground_plane(const Box& bounds, Vec3 up, int material) {
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
