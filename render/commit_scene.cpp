// SPDX-License-Identifier: Apache-2.0
// Makes a Scene (render/scene/scene.h) of a description, a stage and surroundings. The Committer
// checks every number and converts it to the scene frame, leaves out lights that cannot contribute,
// builds Embree's structures and derives the data of shading and culling. Last, the finished scene
// casts the shadow on the ground. This needs shading and culling, which include the scene, so it is
// not part of render/scene.
#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/interval.h"
#include "render/accel/user_geometry.h"
#include "render/culling/shaft.h"
#include "render/loaders/viewer_choices.h"
#include "render/options/render_options.h"
#include "render/scene/scene.h"
#include "render/scene/scene_fingerprint.h"
#include "render/scene/surroundings.h"
#include "render/scene/texture.h"
#include "render/shading/pbr_scene.h"
#include "render/shading/shading.h"
#include "render/shading/shading_tables.h"

namespace lenticule::render {
namespace {

// ---- lights that cannot contribute to any surface

/// Ball that contains every point where a surface can be lit.
struct Ball {
  Vec3 centre;
  double radius = -1.0;  ///< negative if there is no such point

  [[nodiscard]] bool holds(Vec3 p) const { return length(p - centre) <= radius; }
};

Ball ball_around(const Scene& scene) {
  Box bounds;
  for (const MeshShape& mesh : scene.meshes) bounds.extend(box_of(mesh));
  for (const SphereShape& sphere : scene.spheres) bounds.extend(box_of(sphere));
  for (const ConeShape& cone : scene.cones) bounds.extend(box_of(cone));
  if (bounds.empty()) return {};
  Ball ball{(bounds.low + bounds.high) * 0.5, length(bounds.high - bounds.low) * 0.5};
  // Margin: secondary rays start off their surfaces, and points are rounded to single precision.
  ball.radius += 16.0 * double{kRoundingMargin} * (length(ball.centre) + ball.radius);
  return ball;
}

/// Returns true if zero times every reflectance of the scene is zero, which requires all of them to
/// be finite.
bool reflects_finitely(const Scene& scene) {
  constexpr double kMost = 1e15;
  const auto moderate = [](double v) { return std::abs(v) < kMost; };
  const auto tame = [&](const Material& m) {
    return m.shine >= 0.0 && moderate(m.shine) && moderate(m.diffuse) && moderate(m.specular) &&
           moderate(m.colour.x) && moderate(m.colour.y) && moderate(m.colour.z);
  };
  const auto plain = [&](const std::shared_ptr<const Texture>& texture) {
    return !texture || std::ranges::all_of(texture->rgba, [&](float v) { return moderate(v); });
  };
  return std::ranges::all_of(scene.materials, tame) && std::ranges::all_of(scene.textures, plain);
}

bool is_black(const SceneLight& light) {
  const auto none = [](double v) { return static_cast<float>(v) == 0.0F; };
  return none(light.colour.x) && none(light.colour.y) && none(light.colour.z);
}

/// Returns true if a spot's cone does not touch the cone around the ball as seen from the light.
bool shines_past(const SceneLight& light, const Ball& ball) {
  if (light.kind != Light::Kind::Spot) return false;
  constexpr double kRounding = 1e-4;  // covers cosines in single precision, with a margin
  const Vec3 way = ball.centre - light.position;
  const double distance = length(way);
  const double aside = std::acos(std::clamp(dot(way, light.direction) / distance, -1.0, 1.0));
  const double nearest = std::max(0.0, aside - std::asin(std::min(1.0, ball.radius / distance)));
  return std::cos(nearest) < light.cos_outer - kRounding;
}

bool is_idle(const SceneLight& light, const Ball& ball) {
  // Close to a light that falls off, intensities are unbounded.
  const bool apart = ball.radius >= 0.0 && !ball.holds(light.position);
  return (is_black(light) && (apart || !light.falls_off)) || (apart && shines_past(light, ball));
}

/// Removes lights of zero colour, and spots whose cone misses the whole scene, from scene.lights;
/// returns the number of removed lights. Each of them would have added exactly zero to every
/// surface. Must be called before any data is derived from the lights.
size_t remove_idle_lights(Scene& scene) {
  const Ball ball = ball_around(scene);
  const auto idle = [&](const SceneLight& light) { return is_idle(light, ball); };
  // The textures are examined only if a light could be removed.
  if (std::ranges::none_of(scene.lights, idle) || !reflects_finitely(scene)) return 0;
  return std::erase_if(scene.lights, idle);
}

// ---- shadow on the ground
// The shadow of a model on the ground that it stands on is the sum of two layers: a narrow one
// where the model touches the ground, and a wide one of all of it. Each layer takes what hides the
// sky straight above a point, less the higher it is, and blurs that with a kernel that ends at a
// radius.

/// StandingModel describes where a model stands, in the scene frame.
struct StandingModel {
  Interval x, y, z;     ///< bounds; y is up
  double ground = 0.0;  ///< height of the ground
  double size = 0.0;    ///< see Ground
};

/// Layer is one part of the shadow. Lengths are in sizes of the model.
struct Layer {
  double darkness;  ///< under a large flat model that lies on the ground
  double radius;    ///< radius of the blur kernel
  double height;    ///< from which on nothing casts a shadow
};
constexpr std::array<Layer, 2> kLayers{{{0.45, 0.08, 0.25}, {0.45, 0.25, 1.5}}};
constexpr double kWidest = 0.25, kHighest = 1.5;

/// Distance between rays in sizes of the model, and the largest number of rays along a side.
constexpr double kCell = 0.01;
constexpr double kMostRays = 256.0;
/// Offset of the first ray, in distances between rays. Edges of models often lie at whole or simple
/// fractions of the distance, where rounding would decide which rays meet the model, and so the
/// shadow would depend on the model's unit.
constexpr double kBesideEdges = 0.381966;
/// A ray ends at the latest after this many surfaces, or when less than this share of it is left.
constexpr int kMostPassed = 64;
constexpr double kLeastShare = 1e-3;
/// Distance in sizes of the model below the ground at which rays start.
constexpr double kBelow = 1e-3;

using Shares = std::array<double, kLayers.size()>;

/// Adds what a surface at a height above the ground, in sizes of the model, hides of a ray.
void add_hidden(double height, double share, Shares& hidden) {
  for (size_t n = 0; n < kLayers.size(); ++n) {
    const double left = 1.0 - std::max(height, 0.0) / kLayers[n].height;
    if (left > 0.0) hidden[n] += share * left * left;
  }
}

/// Returns what hides the ray straight up from a point, by layer.
Shares hidden_above(const Scene& scene, const StandingModel& model, Vec3 origin) {
  Shares hidden{};
  double share = 1.0;
  for (int n = 0; n < kMostPassed && share > kLeastShare; ++n) {
    const double far = model.ground + kHighest * model.size - origin.y;
    if (!(far > 0.0)) break;
    const std::optional<Surface> surface = first_surface(scene, origin, {0, 1, 0}, far);
    if (!surface) break;
    const Vec3 passed = scene.pbr->any_passes() ? scene.pbr->passed(*surface) : Vec3{};
    const double on = share * (passed.x + passed.y + passed.z) / 3.0;
    add_hidden((surface->point.y - model.ground) / model.size, share - on, hidden);
    share = on;
    origin = spawn_point(*surface, Side::Far);
  }
  return hidden;
}

/// Returns the grid around the model. Its points stay where they are if the model's bounds change.
GroundGrid grid_around(const StandingModel& model) {
  GroundGrid grid{.up = {0, 1, 0}, .across = {1, 0, 0}, .along = {0, 0, 1}};
  grid.height = model.ground;
  grid.cell =
      std::max(kCell * model.size, std::max(model.x.width(), model.z.width()) / (kMostRays - 2.0));
  const double margin = std::ceil(kWidest * model.size / grid.cell) + 1.0;
  const auto first = [&](const Interval& bounds) {
    return std::floor(bounds.low / grid.cell) - margin + kBesideEdges;
  };
  const auto count = [&](const Interval& bounds) {
    return static_cast<int>(
               std::ceil(std::ceil(bounds.high / grid.cell) + margin - first(bounds))) +
           1;
  };
  grid.x = first(model.x) * grid.cell;
  grid.y = first(model.z) * grid.cell;
  grid.columns = count(model.x);
  grid.rows = count(model.z);
  return grid;
}

/// Returns the values blurred along one side of the grid, where `step` is the distance between
/// neighbours. Values near the grid's border are zero, so that none are blurred across it.
std::vector<float> blurred(const std::vector<float>& values, int step, double radius_cells) {
  const int reach = std::max(static_cast<int>(std::ceil(radius_cells)) - 1, 0);
  std::vector<double> kernel;
  double sum = 0.0;
  for (int n = -reach; n <= reach; ++n) {
    const double left = 1.0 - (n / radius_cells) * (n / radius_cells);
    sum += kernel.emplace_back(left * left * left);
  }
  std::vector<float> out(values.size());
  const auto count = static_cast<std::ptrdiff_t>(values.size());
  for (int n = -reach; n <= reach; ++n) {
    const std::ptrdiff_t shift = std::ptrdiff_t{n} * step;
    const auto weight = static_cast<float>(kernel[static_cast<size_t>(n + reach)] / sum);
    const std::ptrdiff_t end = std::min(count, count - shift);
    for (std::ptrdiff_t at = std::max<std::ptrdiff_t>(0, -shift); at < end; ++at)
      out[static_cast<size_t>(at)] += weight * values[static_cast<size_t>(at + shift)];
  }
  return out;
}

/// Traces rays upwards from the ground through a committed scene with metallic-roughness materials,
/// at most 256 x 256. Returns null if the model has no size. The result does not depend on the
/// number of threads. Call it in the arena whose threads it may use.
std::shared_ptr<const GroundShadow> cast_ground_shadow(const Scene& scene,
                                                       const StandingModel& model) {
  if (!(model.size > 0.0) || !std::isfinite(model.size)) return nullptr;
  const GroundGrid grid = grid_around(model);
  const size_t points = static_cast<size_t>(grid.columns) * static_cast<size_t>(grid.rows);
  std::array<std::vector<float>, kLayers.size()> hidden;
  for (std::vector<float>& layer : hidden) layer.resize(points);
  const double start = std::min(grid.height, model.y.low) - kBelow * model.size;
  tbb::parallel_for(0, grid.rows, [&](int row) {
    if (const double y = grid.y + row * grid.cell; y < model.z.low || y > model.z.high) return;
    for (int column = 0; column < grid.columns; ++column) {
      if (const double x = grid.x + column * grid.cell; x < model.x.low || x > model.x.high)
        continue;
      const Vec3 from = grid.point(column, row) + grid.up * (start - grid.height);
      const Shares shares = hidden_above(scene, model, from);
      for (size_t n = 0; n < kLayers.size(); ++n)
        hidden[n][static_cast<size_t>(row) * static_cast<size_t>(grid.columns) +
                  static_cast<size_t>(column)] = static_cast<float>(shares[n]);
    }
  });
  std::vector<float> darkness(points);
  for (size_t n = 0; n < kLayers.size(); ++n) {
    const double radius = kLayers[n].radius * model.size / grid.cell;
    const std::vector<float> soft = blurred(blurred(hidden[n], 1, radius), grid.columns, radius);
    for (size_t at = 0; at < points; ++at)
      darkness[at] += static_cast<float>(kLayers[n].darkness) * soft[at];
  }
  return std::make_shared<const GroundShadow>(grid, std::move(darkness));
}

// ---- commit

/// Largest coordinate in scene units: beyond it, single precision is useless and Embree silently
/// drops the primitive.
constexpr double kFarthest = 1e15;

/// Scene units between the possible origins of scene frames, and an offset: the points that files
/// prefer as centres do not lie halfway between two of them, where rounding decides.
constexpr double kOriginStep = 512.0;
constexpr double kBesideHalf = 0.118034;

/// Returns the number without its last bits, which rounding changes while a stage turns.
double shortened(double number) {
  const double high = number * 8193.0;  // 2^13 + 1: 40 bits remain
  return high - (high - number);
}

/// Returns a power of two near the number, whose products are exact. At the limit between two
/// powers rounding decides, so it is a ratio that scales seldom have.
double power_of_two_near(double number) {
  constexpr double kLimit = 0.763932;
  int exponent = 0;
  const double fraction = std::frexp(number, &exponent);
  return number / fraction * (fraction < kLimit ? 0.5 : 1.0);
}

/// Largest number of primitives for which a culling tree is built: above it, the build takes longer
/// than a frame gains.
constexpr size_t kMostProvable = size_t{1} << 19;

/// Least number of triangles of a shape of which Embree gets instances.
constexpr size_t kLeastInstance = 64;

/// Committer converts one description to the scene frame and checks every number.
class Committer {
 public:
  Committer(const SceneDescription& description, const Stage& stage, int threads, Scene& scene)
      : description_(description), stage_(stage), threads_(threads), scene_(scene) {}

  void commit(const Surroundings& surroundings, IdleLights idle_lights) {
    scene_.frame = frame();
    scene_.described = scene_fingerprint(description_, surroundings);
    add_materials();
    if (surroundings.tone_map.value_or(ToneMap::None) != ToneMap::None && !is_pbr_)
      refuse("tone map:", "no material is metallic-roughness");
    auto shown = description_.meshes.begin();
    for_each_mesh(description_, [&](const TriangleMesh& mesh) { add_mesh(mesh, &*shown++); });
    for (const Sphere& sphere : description_.spheres) add_sphere(sphere);
    for (const Cone& cone : description_.cones) add_cone(cone);
    if (surroundings.ground) add_ground(surroundings);
    add_lights();
    scene_.ambient =
        description_.ambient.value_or(Vec3{kDefaultAmbient, kDefaultAmbient, kDefaultAmbient});
    if (!is_finite(scene_.ambient)) refuse("ambient light", "is not finite");
    scene_.backdrop = make_backdrop(description_, stage_, surroundings);
    if (is_pbr_) set_pbr_backdrop(surroundings);
    scene_.colour_managed = description_.colour_managed;
    scene_.textures = description_.textures;
    set_stage(surroundings);
    if (idle_lights == IdleLights::LeaveOut) scene_.lights_left_out = remove_idle_lights(scene_);
    has_ground_shadow_ = has_studio() && scene_.backdrop.flat() && surroundings.ground_shadow &&
                         !surroundings.ground;
    build();
  }

  bool place(const Surroundings& surroundings) {
    if (frame() != scene_.frame) return false;
    is_pbr_ = scene_.pbr != nullptr;
    set_stage(surroundings);
    if (has_default_sun()) use_lights();
    if (is_pbr_) scene_.pbr = std::make_unique<const PbrScene>(scene_, has_studio());
    return true;
  }

 private:
  [[noreturn]] void refuse(const std::string& object, const std::string& cause) const {
    throw Error(ErrorKind::Input, fmt::format("{}: {} {}", description_.source, object, cause));
  }

  /// Depends on the stage alone, so that a frame has the same bytes after any others.
  [[nodiscard]] SceneFrame frame() const {
    const Affine& world_from_panel = stage_.world_from_panel;
    const double world_per_mm = length(world_from_panel.column_x);
    const double units_per_world = power_of_two_near(1.0 / world_per_mm);
    if (!(world_per_mm > 0.0) || !std::isfinite(units_per_world) ||
        !std::isnormal(world_from_panel.determinant()) || !is_finite(world_from_panel.origin))
      refuse("stage", "has no usable size");
    const double step = kOriginStep / units_per_world;
    const auto near = [&](double v) { return std::round(v / step + kBesideHalf) * step; };
    const Vec3& centre = world_from_panel.origin;
    return {units_per_world,
            {near(centre.x), near(centre.y), near(centre.z)},
            world_up(stage_),
            stage_.ground};
  }

  /// Sets everything that depends on the stage, apart from tables.
  void set_stage(const Surroundings& surroundings) {
    const Affine& world_from_panel = stage_.world_from_panel;
    const auto& [units, origin, up, ground] = scene_.frame;
    scene_.scene_from_panel = {world_from_panel.column_x * units, world_from_panel.column_y * units,
                               world_from_panel.column_z * units,
                               (world_from_panel.origin - origin) * units};
    const double before = scene_.units_per_mm;
    scene_.units_per_mm = shortened(length(scene_.scene_from_panel.column_x));
    if (scene_.shaft_cache && scene_.units_per_mm != before) scene_.shaft_cache->forget_sizes();
    set_near(surroundings.ground && !scene_.meshes.empty());
    turn_to(stage_, scene_.backdrop);
    SceneMixer mixer;
    mixer.add(scene_.described.first, scene_.described.second);
    // The default sun and the studio stand beside the viewer.
    if (is_unlit()) mixer.add(world_direction(stage_, kDefaultSunDirection));
    if (has_default_sun())
      scene_.lights = {{.kind = Light::Kind::Directional,
                        .direction = world_direction(stage_, kDefaultSunDirection),
                        .colour = Vec3{1, 1, 1} * kDefaultSun}};
    scene_.content = mixer.value();
    scene_.picture = picture_fingerprint(scene_.content, stage_);
  }

  /// `has_ground`: the last mesh is the ground.
  void set_near(bool has_ground) {
    const Affine map = scene_.scene_from_panel.inverse();
    const Vec3 depth{map.column_x.z, map.column_y.z, map.column_z.z};
    double nearest = -std::numeric_limits<double>::infinity();
    const auto meet = [&](Vec3 p) { nearest = std::max(nearest, dot(depth, p) + map.origin.z); };
    const auto see = [&](const MeshShape& mesh) {
      for (const Vec3f& p : mesh.vertices()) meet(Vec3(p));
      for (const uint32_t number : mesh.wide)
        if (number != MeshShape::kNotWide)
          std::ranges::for_each(scene_.wide_triangles[number].corner, meet);
    };
    for (size_t n = 0; n + size_t{has_ground} < scene_.meshes.size(); ++n) see(scene_.meshes[n]);
    for (const SphereShape& sphere : scene_.spheres)
      nearest = std::max(nearest, box_of(sphere, map).high.z);
    for (const ConeShape& cone : scene_.cones)
      nearest = std::max(nearest, box_of(cone, map).high.z);
    // Content that the stage leaves out in front stays left out; only the ground extends toward the
    // viewer.
    nearest = std::min(nearest, stage_.near_mm);
    if (has_ground) see(scene_.meshes.back());
    scene_.near_mm = std::isfinite(nearest) ? nearest : 0.0;
  }

  Vec3 scene_point(Vec3 world, const char* what, const std::string& name) const {
    const Vec3 p = (world - scene_.frame.origin) * scene_.frame.units_per_world;
    if (!is_finite(world))
      refuse(fmt::format("{} '{}'", what, name), "has a position that is not finite");
    if (!(largest_size(p) < kFarthest))
      refuse(fmt::format("{} '{}'", what, name), "is too far from the stage");
    return p;
  }

  double scene_length(double world, const char* what) const {
    const double l = world * scene_.frame.units_per_world;
    if (!(world >= 0.0) || !(l < kFarthest)) refuse(what, fmt::format("has a radius of {}", world));
    return l;
  }

  int material_index(int index, const std::string& object) const {
    const auto count = static_cast<int>(scene_.materials.size());
    if (index < 0 || index >= count)
      refuse(object, fmt::format("refers to material {}, which does not exist", index));
    return index;
  }

  void add_materials() {
    scene_.materials = description_.materials;
    if (scene_.materials.empty()) scene_.materials.emplace_back();
    const auto has_pbr = [](const Material& m) { return m.pbr != nullptr; };
    is_pbr_ = (description_.lit_by_studio && is_unlit()) ||
              std::ranges::any_of(scene_.materials, has_pbr);
    for (Material& m : scene_.materials) {
      const std::string object = fmt::format("material '{}'", m.name);
      if (m.pbr) {
        check(*m.pbr, object);
        m = {.name = m.name, .pbr = m.pbr};
        continue;
      }
      if (is_pbr_) m.pbr = std::make_shared<const PbrMaterial>(pbr_like(m));
      if (!is_texture(m.texture)) refuse(object, "refers to a texture that does not exist");
      const double scalars[] = {m.diffuse, m.specular, m.shine, m.transmittance};
      const bool finite = is_finite(m.colour) && is_finite(m.emission) &&
                          std::all_of(std::begin(scalars), std::end(scalars),
                                      [](double v) { return std::isfinite(v); });
      if (!finite) refuse(object, "has a value that is not finite");
      if (!(m.refraction_index > 0.0) || !std::isfinite(m.refraction_index))
        refuse(object, fmt::format("has a refraction index of {}", m.refraction_index));
    }
  }

  /// Returns true for -1, no texture, as well.
  bool is_texture(int index) const {
    if (index < 0) return true;
    const auto& all = description_.textures;
    const auto at = static_cast<size_t>(index);
    return at < all.size() && all[at] && is_complete(*all[at]);
  }

  void check(const PbrMaterial& m, const std::string& object) const {
    for (const auto texture : kPbrTextures) {
      const TextureUse& use = m.*texture;
      if (!is_texture(use.texture)) refuse(object, "names a texture that is not there");
      if (!std::ranges::all_of(use.uv_map, [](double v) { return std::isfinite(v); }))
        refuse(object, "has a texture transform that is not finite");
    }
    const bool finite =
        std::ranges::all_of(kPbrNumbers,
                            [&](auto number) {
                              // The attenuation distance may be infinite.
                              return number == &PbrMaterial::attenuation_distance ||
                                     std::isfinite(m.*number);
                            }) &&
        std::ranges::all_of(kPbrColours, [&](auto colour) { return is_finite(m.*colour); });
    if (!finite || !(m.attenuation_distance > 0.0))
      refuse(object, "has a value that is not finite");
    if (m.ior < 0.0) refuse(object, fmt::format("has a refraction index of {}", m.ior));
  }

  [[nodiscard]] bool is_unlit() const {
    return description_.lights.empty() && !description_.ambient;
  }
  [[nodiscard]] bool has_studio() const { return is_pbr_ && is_unlit(); }

  void set_pbr_backdrop(const Surroundings& surroundings) {
    Backdrop& backdrop = scene_.backdrop;
    const bool is_lit_by_pictures = has_studio() || backdrop.environment;
    backdrop.tone_map =
        surroundings.tone_map.value_or(is_lit_by_pictures ? ToneMap::PbrNeutral : ToneMap::None);
    if (!surroundings.background)
      backdrop.colour = studio_background(description_).value_or(backdrop.colour);
  }

  /// `shown` is the mesh before its shape was copied, or null.
  void add_mesh(const TriangleMesh& mesh, const TriangleMesh* shown = nullptr) {
    LENTICULE_CHECK(mesh.node < 0);
    const std::string object = fmt::format("mesh '{}'", mesh.name);
    if (mesh.triangles.empty()) return;
    const auto require = [&](size_t count, const char* what) {
      if (count != 0 && count != mesh.positions.size())
        refuse(object, fmt::format("has a different number of {} than vertices", what));
    };
    require(mesh.normals.size(), "normals");
    require(mesh.uvs.size(), "texture coordinates");
    if (is_pbr_) {
      require(mesh.uvs2.size(), "second texture coordinates");
      require(mesh.colours.size(), "colours");
      require(mesh.tangents.size(), "tangents");
    }
    if (mesh.triangles.size() > std::numeric_limits<uint32_t>::max() / 4)
      refuse(object, "has too many triangles");
    for (const auto& triangle : mesh.triangles)
      for (const uint32_t vertex : triangle)
        if (vertex >= mesh.positions.size())
          refuse(object, fmt::format("refers to vertex {}, which does not exist", vertex));

    MeshShape shape;
    shape.material = material_index(mesh.material, object);
    shape.triangles = mesh.triangles;
    shape.uvs = mesh.uvs;
    if (is_pbr_) {
      shape.uvs2 = mesh.uvs2;
      shape.colours = mesh.colours;
      shape.tangents = mesh.tangents;
    }
    shape.positions.reserve(mesh.positions.size() + 1);
    std::vector<Vec3> exact;
    exact.reserve(mesh.positions.size());
    for (const Vec3& position : mesh.positions) {
      const Vec3 p = scene_point(position, "mesh", mesh.name);
      exact.push_back(p);
      shape.positions.emplace_back(p);
    }
    find_wide_triangles(exact, shape);
    shape.positions.emplace_back();
    shape.normals.reserve(mesh.normals.size());
    for (const Vec3& normal : mesh.normals) {
      if (!is_finite(normal)) refuse(object, "has a normal that is not finite");
      shape.normals.emplace_back(normal);
    }
    scene_.meshes.push_back(std::move(shape));
    instances_.push_back(shown && can_be_instance(*shown) ? shown : nullptr);
    if (instances_.back() && std::exchange(prototype_of(*shown).is_shown, true))
      repeated_triangles_ += mesh.triangles.size();
  }

  /// Prototype is a shape in Embree, with sizes of 1 around the origin.
  struct Prototype {
    Vec3 centre;                     ///< middle of the shape's bounds
    double size = 0.0;               ///< half of its longest side
    bool is_shown = false;           ///< a mesh that can be an instance shows it
    EmbreeHandle<RTCScene> scene{};  ///< made on first use
  };

  Prototype& prototype_of(const TriangleMesh& shown) {
    const auto [known, is_new] = prototypes_.try_emplace(shown.shape);
    Prototype& prototype = known->second;
    if (!is_new) return prototype;
    Box bounds;
    for (const Vec3& p : description_.shape_of(shown).positions) bounds.extend(p);
    prototype.centre = (bounds.low + bounds.high) * 0.5;
    prototype.size = largest_size(bounds.high - prototype.centre);
    return prototype;
  }

  [[nodiscard]] Affine scene_from_prototype(const TriangleMesh& shown) {
    const auto& [units, origin, up, ground] = scene_.frame;
    const auto scaled = [](double by, Vec3 to) {
      return Affine{{by, 0, 0}, {0, by, 0}, {0, 0, by}, to};
    };
    const Prototype& prototype = prototype_of(shown);
    return scaled(units, -origin * units) * shown.place * scaled(prototype.size, prototype.centre);
  }

  /// Returns false if the last mesh of the scene differs from its shape by more than its place, if
  /// it is so small that Embree's scene of it would be larger, or if single precision would lose
  /// digits in the prototype's frame: a shape may be stretched along its axes, but not be sheared
  /// much. See embree_accepts() for the smallest size.
  [[nodiscard]] bool can_be_instance(const TriangleMesh& shown) {
    const MeshShape& mesh = scene_.meshes.back();
    if (shown.shape < 0 || !mesh.wide.empty() || mesh.triangles.size() < kLeastInstance ||
        mesh.triangles.size() != description_.shape_of(shown).triangles.size())
      return false;
    constexpr double kSmallest = 1.0 / 32.0, kLargest = 1e5;
    const Affine map = scene_from_prototype(shown);
    const double x = length(map.column_x), y = length(map.column_y), z = length(map.column_z);
    const auto [least, most] = std::minmax({x, y, z});
    return least > kSmallest && most < kLargest && 2.0 * std::abs(map.determinant()) > x * y * z;
  }

  void find_wide_triangles(const std::vector<Vec3>& positions, MeshShape& shape) {
    const auto geometry = static_cast<uint32_t>(scene_.meshes.size());
    for (size_t n = 0; n < shape.triangles.size(); ++n) {
      const std::array<uint32_t, 3>& triangle = shape.triangles[n];
      const std::array<Vec3, 3> corner = {positions[triangle[0]], positions[triangle[1]],
                                          positions[triangle[2]]};
      if (!is_wide(corner)) continue;
      if (shape.wide.empty()) {
        shape.wide.assign(shape.triangles.size(), MeshShape::kNotWide);
        shape.narrow_triangles = shape.triangles;
      }
      shape.wide[n] = static_cast<uint32_t>(scene_.wide_triangles.size());
      shape.narrow_triangles[n] = {triangle[0], triangle[0], triangle[0]};
      WideTriangle& wide = scene_.wide_triangles.emplace_back(make_wide_triangle(corner));
      wide.geometry = geometry;
      wide.primitive = static_cast<uint32_t>(n);
    }
  }

  void add_sphere(const Sphere& sphere) {
    const SphereShape shape{.centre = scene_point(sphere.centre, "sphere", "centre"),
                            .radius = scene_length(sphere.radius, "sphere"),
                            .inward = sphere.inward,
                            .material = material_index(sphere.material, "sphere")};
    scene_.spheres.push_back(shape);
  }

  void add_cone(const Cone& cone) {
    const Vec3 base = scene_point(cone.base, "cone", "base");
    const Vec3 apex = scene_point(cone.apex, "cone", "apex");
    const double base_radius = scene_length(cone.base_radius, "cone");
    const double apex_radius = scene_length(cone.apex_radius, "cone");
    const double height = length(apex - base);
    if (!(height > 0.0)) refuse("cone", "has no height");
    const ConeShape shape{.base = base,
                          .axis = (apex - base) / height,
                          .height = height,
                          .base_radius = base_radius,
                          .slope = (apex_radius - base_radius) / height,
                          .inward = cone.inward,
                          .material = material_index(cone.material, "cone")};
    scene_.cones.push_back(shape);
  }

  void add_ground(const Surroundings& surroundings) {
    if (!is_finite(surroundings.ground_colour)) refuse("ground", "has a colour that is not finite");
    const Box bounds = scene_bounds(description_);
    if (bounds.empty()) return;
    scene_.materials.push_back({.name = "ground", .colour = surroundings.ground_colour});
    if (is_pbr_)
      scene_.materials.back().pbr =
          std::make_shared<const PbrMaterial>(pbr_like(scene_.materials.back()));
    add_mesh(ground_plane(bounds, scene_.frame.up, static_cast<int>(scene_.materials.size()) - 1));
  }

  void add_lights() {
    for (const Light& light : description_.lights) {
      LENTICULE_CHECK(light.node < 0);
      const bool placed = light.kind != Light::Kind::Directional;
      const bool aimed = light.kind != Light::Kind::Point;
      if (!is_finite(light.colour) || (aimed && !is_finite(light.direction)))
        refuse("light", "has a value that is not finite");
      const Vec3 direction = normalized(light.direction);
      if (aimed && direction == Vec3{}) refuse("light", "has no direction");
      scene_.lights.push_back(
          {.kind = light.kind,
           .position = placed ? scene_point(light.position, "light", "position") : Vec3{},
           .direction = direction,
           .colour = light.colour,
           .falls_off = light.falls_off,
           .cos_inner = light.cos_inner,
           .cos_outer = light.cos_outer});
    }
  }

  /// Returns false for a file that states an ambient light: it defines its own lighting.
  [[nodiscard]] bool has_default_sun() const { return is_unlit() && !is_pbr_; }

  void build() {
    const RTCDevice device = scene_.device.get();
    scene_.embree.reset(rtcNewScene(device));
    scene_.device.check(description_.source);
    // Robust mode: no ray passes between two triangles of a closed surface. Regular grids of rays
    // on regular meshes do hit edges and vertices.
    rtcSetSceneFlags(scene_.embree.get(), RTC_SCENE_FLAG_ROBUST);
    // Instances save memory, but cost time for each ray.
    const bool has_instances = repeated_triangles_ > kMostProvable;
    for (size_t i = 0; i < scene_.meshes.size(); ++i) {
      const MeshShape& mesh = scene_.meshes[i];
      const bool is_instance = has_instances && instances_[i];
      attach(is_instance ? instance_geometry(*instances_[i]) : mesh_geometry(mesh),
             {GeometryEntry::Kind::Mesh, i},
             is_instance ? SceneFeature::Instances : SceneFeature::Triangles,
             {mesh.positions.data(), embree_corners(mesh).data()});
    }
    if (!scene_.spheres.empty())
      attach(make_sphere_geometry(device, scene_.spheres), {GeometryEntry::Kind::Spheres});
    if (!scene_.cones.empty())
      attach(make_cone_geometry(device, scene_.cones), {GeometryEntry::Kind::Cones});
    if (!scene_.wide_triangles.empty())
      attach_last(make_wide_geometry(device, scene_.wide_triangles), SceneFeature::UserGeometry);
    rtcCommitScene(scene_.embree.get());
    scene_.device.check(description_.source);
    if (primitives() <= kMostProvable) scene_.tree = std::make_unique<const PrimitiveTree>(scene_);
    use_lights();
    if (is_pbr_)
      tbb::task_arena(arena_threads(threads_)).execute([this] {
        scene_.pbr = std::make_unique<const PbrScene>(scene_, has_studio());
        if (has_ground_shadow_) add_ground_shadow();
      });
  }

  void use_lights() {
    scene_.shading = std::make_unique<const ShadingTables>(scene_);
    if (scene_.tree) scene_.shaft_cache = std::make_unique<ShaftCache>(scene_, *scene_.tree);
  }

  void add_ground_shadow() {
    const Box bounds = scene_bounds(description_);
    if (bounds.empty()) return;
    const Ground ground = stage_.ground.value_or(ground_under(bounds));
    const double units = scene_.frame.units_per_world;
    const Vec3 low = (bounds.low - scene_.frame.origin) * units;
    const Vec3 high = (bounds.high - scene_.frame.origin) * units;
    scene_.backdrop.ground_shadow =
        cast_ground_shadow(scene_, {.x = {low.x, high.x},
                                    .y = {low.y, high.y},
                                    .z = {low.z, high.z},
                                    .ground = (ground.y - scene_.frame.origin.y) * units,
                                    .size = ground.size * units});
  }

  [[nodiscard]] size_t primitives() const {
    size_t sum = scene_.spheres.size() + scene_.cones.size();
    for (const MeshShape& mesh : scene_.meshes) sum += mesh.triangles.size();
    return sum;
  }

  /// Returns the triangles that Embree gets; wide ones have no area.
  static const std::vector<std::array<uint32_t, 3>>& embree_corners(const MeshShape& mesh) {
    return mesh.wide.empty() ? mesh.triangles : mesh.narrow_triangles;
  }

  EmbreeGeometry mesh_geometry(const MeshShape& mesh) const {
    EmbreeGeometry geometry(rtcNewGeometry(scene_.device.get(), RTC_GEOMETRY_TYPE_TRIANGLE));
    if (!geometry) return geometry;
    rtcSetSharedGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                               mesh.positions.data(), 0, sizeof(Vec3f), mesh.positions.size() - 1);
    const auto& triangles = embree_corners(mesh);
    rtcSetSharedGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                               triangles.data(), 0, sizeof(triangles[0]), triangles.size());
    rtcSetGeometryMask(geometry.get(), ~0U);
    rtcCommitGeometry(geometry.get());
    return geometry;
  }

  void make_scene(Prototype& prototype, const TriangleMesh& shape) const {
    const EmbreeGeometry geometry(rtcNewGeometry(scene_.device.get(), RTC_GEOMETRY_TYPE_TRIANGLE));
    void* const positions =
        rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                sizeof(Vec3f), shape.positions.size());
    void* const triangles =
        rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                sizeof(shape.triangles[0]), shape.triangles.size());
    scene_.device.check(description_.source);
    std::ranges::transform(shape.positions, static_cast<Vec3f*>(positions),
                           [&](Vec3 p) { return Vec3f((p - prototype.centre) / prototype.size); });
    std::ranges::copy(shape.triangles, static_cast<std::array<uint32_t, 3>*>(triangles));
    rtcCommitGeometry(geometry.get());
    prototype.scene.reset(rtcNewScene(scene_.device.get()));
    rtcAttachGeometry(prototype.scene.get(), geometry.get());
    rtcSetSceneFlags(prototype.scene.get(), RTC_SCENE_FLAG_ROBUST);
    rtcCommitScene(prototype.scene.get());
  }

  EmbreeGeometry instance_geometry(const TriangleMesh& shown) {
    Prototype& prototype = prototype_of(shown);
    if (!prototype.scene) make_scene(prototype, description_.shape_of(shown));
    const Affine map = scene_from_prototype(shown);
    const std::array<Vec3f, 4> columns{Vec3f(map.column_x), Vec3f(map.column_y),
                                       Vec3f(map.column_z), Vec3f(map.origin)};
    EmbreeGeometry geometry(rtcNewGeometry(scene_.device.get(), RTC_GEOMETRY_TYPE_INSTANCE));
    rtcSetGeometryInstancedScene(geometry.get(), prototype.scene.get());
    rtcSetGeometryTransform(geometry.get(), 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns.data());
    rtcSetGeometryMask(geometry.get(), ~0U);
    rtcCommitGeometry(geometry.get());
    return geometry;
  }

  void attach(EmbreeGeometry geometry, GeometryEntry entry,
              SceneFeature feature = SceneFeature::UserGeometry, EmbreeTriangles triangles = {}) {
    attach_last(std::move(geometry), feature, triangles);
    scene_.geometries.push_back(entry);
  }

  /// Attaches a geometry without a GeometryEntry: its hits report the numbers of other geometries.
  void attach_last(EmbreeGeometry geometry, SceneFeature feature, EmbreeTriangles triangles = {}) {
    scene_.device.check(description_.source);
    LENTICULE_CHECK(geometry != nullptr);
    scene_.embree.attach(geometry.get(), static_cast<unsigned>(scene_.geometries.size()), feature,
                         triangles);
  }

  const SceneDescription& description_;
  const Stage& stage_;
  int threads_;
  Scene& scene_;
  /// Per mesh of the scene: its mesh in the description if that can be an instance, or null.
  std::vector<const TriangleMesh*> instances_;
  std::map<int, Prototype> prototypes_;  ///< keys are numbers of shapes
  size_t repeated_triangles_ = 0;  ///< sum over possible instances, but the first of each shape
  bool is_pbr_ = false;
  bool has_ground_shadow_ = false;
};

}  // namespace

Scene::Scene(const SceneDescription& description, const Stage& stage,
             const Surroundings& surroundings, int threads, IdleLights idle_lights)
    : device(threads) {
  Committer(description, stage, threads, *this).commit(surroundings, idle_lights);
}

Scene::~Scene() = default;

bool Scene::place(const SceneDescription& description, const Stage& stage,
                  const Surroundings& surroundings) {
  return Committer(description, stage, 0, *this).place(surroundings);
}

const Scene& SceneKeeper::commit(const std::shared_ptr<const SceneDescription>& description,
                                 const Stage& stage) {
  const bool is_same =
      scene_ && (description_.lock() == description ||
                 (scene_->described == scene_fingerprint(*description, surroundings_) &&
                  std::ranges::equal(scene_->textures, description->textures, same_texture)));
  if (!is_same || !scene_->place(*description, stage, surroundings_)) {
    scene_.reset();
    scene_ = std::make_unique<Scene>(*description, stage, surroundings_, threads_);
  }
  description_ = description;
  return *scene_;
}

std::array<Vec3, 3> corners_of(const Scene& scene, const MeshShape& mesh, uint32_t triangle) {
  if (const WideTriangle* wide = scene.wide_triangle(mesh, triangle)) return wide->corner;
  const auto& [a, b, c] = mesh.triangles[triangle];
  return {Vec3(mesh.positions[a]), Vec3(mesh.positions[b]), Vec3(mesh.positions[c])};
}

}  // namespace lenticule::render
