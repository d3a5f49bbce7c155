// SPDX-License-Identifier: Apache-2.0
// PbrTracer follows the rays of a packet through a scene with metallic-roughness materials: through
// surfaces that are cut out, blended or transmit light, until they end. It computes three channels
// per ray, since a tone map needs them all. Points on most materials are shaded in lanes, all
// others one by one.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>

#include "base/error.h"
#include "render/accel/ray_stream.h"
#include "render/integrator/light_cache.h"
#include "render/options/render_options.h"
#include "render/rays/primary_packets.h"
#include "render/rays/primary_rays.h"
#include "render/scene/scene.h"
#include "render/scene/texture.h"
#include "render/shading/pbr_scene.h"
#include "render/shading/shading.h"
#include "render/shading/shading_tables.h"

namespace lenticule::render {

/// Three numbers of each lane of a packet.
struct alignas(64) ColourLanes {
  float rgb[3][kPacket];

  [[nodiscard]] Vec3 of(size_t lane) const {
    return {double{rgb[0][lane]}, double{rgb[1][lane]}, double{rgb[2][lane]}};
  }
  void set(size_t lane, Vec3 colour) {
    rgb[0][lane] = static_cast<float>(colour.x);
    rgb[1][lane] = static_cast<float>(colour.y);
    rgb[2][lane] = static_cast<float>(colour.z);
  }
};

inline void set_lane(Vec3 from, size_t lane, float (&v)[3][kPacket]) {
  v[0][lane] = static_cast<float>(from.x);
  v[1][lane] = static_cast<float>(from.y);
  v[2][lane] = static_cast<float>(from.z);
}

/// PbrLanes serves one packet at a time. Thread safety: used by one thread.
class PbrLanes {
 public:
  explicit PbrLanes(Isa isa) : kernel_(pbr_kernel_for(isa)) {}

  /// Found are bit masks of the lanes that met plain materials.
  struct Found {
    uint32_t all = 0;
    uint32_t shown = 0;    ///< not transparent: the lanes that the following functions shade
    uint32_t passing = 0;  ///< not opaque
  };
  /// Finds the points of those of `lanes` that the kernel can shade.
  Found find(const Scene& scene, const BeamSize& beam, const RayPacket& packet, uint32_t lanes) {
    if (!scene.pbr->any_plain()) return {};
    alignas(64) int valid[kPacket];
    for (size_t r = 0; r < kPacket; ++r) valid[r] = (lanes & kLaneBit[r]) != 0 ? -1 : 0;
    Found found{.all = kernel_.find(scene.pbr->tables(), scene.pbr->beam(beam),
                                    &packet.rays.ray.org_x[0], valid, surfaces_, points_)};
    if (found.all == 0) return found;
    for (uint32_t left = points_.textured; left != 0;) left &= ~apply_textures(scene, packet, left);
    for (size_t r = 0; r < kPacket; ++r) {
      found.shown |= points_.alpha[r] > 0.0F ? kLaneBit[r] : 0;
      found.passing |= points_.alpha[r] < 1.0F ? kLaneBit[r] : 0;
    }
    found.shown &= found.all;
    found.passing &= found.all;
    for (size_t r = 0; r < kPacket; ++r)
      points_.active[r] = (found.shown & kLaneBit[r]) != 0 ? -1 : 0;
    return found;
  }
  /// Returns memory for look-ups, which find() overwrites.
  [[nodiscard]] LaneTextures& textures() { return textures_; }
  /// Returns the share of the light that a point does not let pass.
  [[nodiscard]] double alpha(size_t lane) const { return double{points_.alpha[lane]}; }
  /// Returns the start of a ray that goes on behind a point.
  [[nodiscard]] Vec3 behind(size_t lane) const {
    return lane_of(surfaces_.point, lane) -
           lane_of(surfaces_.geometric, lane) * double{surfaces_.spawn_offset[lane]};
  }
  /// Returns true if a lane met the outer side of its surface.
  [[nodiscard]] bool is_outside(size_t lane) const { return surfaces_.outer_side[lane] != 0; }
  /// Returns the light of the environment that the points reflect, and what they emit. Other lanes
  /// are unspecified.
  void shade(const Scene& scene, ColourLanes& light) {
    const pbr_kernel::Tables& tables = scene.pbr->tables();
    kernel_.aim(tables, surfaces_, points_, shaded_);
    set_source(scene, shaded_.sharp, shaded_.mirror, shaded_.source);
    set_source(scene, shaded_.coat_sharp, shaded_.coat_mirror, shaded_.coat_source);
    kernel_.shade(tables, points_, shaded_);
    static_assert(sizeof light.rgb == sizeof shaded_.light);
    std::memcpy(light.rgb, shaded_.light, sizeof light.rgb);
  }
  /// Makes rays toward a light from the points it can shine on, harmless rays in all other lanes.
  /// `brings` is the light that each adds if unoccluded.
  void light_rays(const Scene& scene, size_t light, RTCRay16& rays, int* valid, ColourLanes& brings,
                  FrameCounts& counts) const {
    pbr_kernel::LightRays out;
    out.packet = &rays.org_x[0];
    out.valid = valid;
    kernel_.light_rays(scene.shading->lights()[light], surfaces_, points_, shaded_, out);
    counts.invalid_rays += static_cast<uint64_t>(out.refused);
    std::memcpy(brings.rgb, out.brings, sizeof brings.rgb);
  }
  void tone_map(ToneMap map, const ColourLanes& light, ColourLanes& shown) const {
    using enum pbr_kernel::ToneMap;
    kernel_.tone_map(map == ToneMap::PbrNeutral ? kPbrNeutral
                     : map == ToneMap::Aces     ? kAces
                                                : kNone,
                     light.rgb, shown.rgb);
  }

 private:
  static Vec3 lane_of(const float (&v)[3][kPacket], size_t lane) {
    return {double{v[0][lane]}, double{v[1][lane]}, double{v[2][lane]}};
  }
  static Vec2 lane_of(const float (&v)[2][kPacket], size_t lane) {
    return {double{v[0][lane]}, double{v[1][lane]}};
  }

  /// Looks up the light of the environment's source in some lanes.
  static void set_source(const Scene& scene, uint32_t lanes, const float (&mirror)[3][kPacket],
                         float (&source)[3][kPacket]) {
    for (uint32_t left = lanes; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      set_lane(scene.pbr->environment().source(normalized(lane_of(mirror, r))), r, source);
    }
  }
  /// Applies the textures of the first of `lanes` and of those that met the same geometry and
  /// material; returns these lanes.
  uint32_t apply_textures(const Scene& scene, const RayPacket& packet, uint32_t lanes) {
    const auto first = static_cast<size_t>(std::countr_zero(lanes));
    const RTCHit16& hit = packet.rays.hit;
    uint32_t same = 0;
    for (size_t r = 0; r < kPacket; ++r)
      same |=
          hit.geomID[r] == hit.geomID[first] && surfaces_.material[r] == surfaces_.material[first]
              ? kLaneBit[r]
              : 0;
    same &= lanes;
    const auto number = static_cast<size_t>(surfaces_.material[first]);
    const GeometryEntry& geometry = scene.geometries[hit.geomID[first]];
    const MeshShape* mesh =
        geometry.kind == GeometryEntry::Kind::Mesh ? &scene.meshes[geometry.mesh] : nullptr;
    textures_.start(mesh);
    for (uint32_t left = same; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      SurfacePlace place{.at = {double{surfaces_.u[r]}, double{surfaces_.v[r]}},
                         .across = lane_of(points_.across, r),
                         .along = lane_of(points_.along, r)};
      if (mesh != nullptr) place.corners = mesh->triangles[hit.primID[r]];
      textures_.add(r, place);
    }
    kernel_.apply(scene.pbr->tables().materials[number],
                  textures_.all(*scene.materials[number].pbr, scene.pbr->inputs(number)), surfaces_,
                  points_);
    return same;
  }

  const pbr_kernel::Kernel& kernel_;
  LaneTextures textures_;
  shading_kernel::Surfaces surfaces_{};
  pbr_kernel::Points points_{};
  pbr_kernel::Shaded shaded_{};
};

/// PbrTracer serves one packet at a time. Thread safety: used by one thread.
class PbrTracer {
 public:
  /// `max_depth` as in RenderOptions: rays that are refracted more often see the backdrop.
  PbrTracer(int max_depth, Isa isa) : most_bends_(max_depth), plain_(isa) {
    init_packets({&next_, 1});
    shadow_ = next_.rays.ray;
  }

  /// Shades the lanes of a packet that met a surface, and writes their light after the tone map, in
  /// channel[r], to light[r]; other elements of `light` are unchanged. `cache` notes the paths and
  /// knows lights already, unless it is null. The calling thread must flush denormals.
  void shade(const Scene& scene, const BeamSize& beam, std::span<const int32_t, kPacket> channel,
             const RayPacket& packet, std::span<float, kPacket> light, LightCache* cache,
             FrameCounts& counts, WorkClock& clock) {
    cache_ = cache;
    const View view{scene, *scene.pbr, beam};
    uint32_t lanes = 0;
    for (size_t r = 0; r < kPacket; ++r)
      if (packet.valid[r] != 0 && packet.rays.hit.geomID[r] != RTC_INVALID_GEOMETRY_ID)
        lanes |= kLaneBit[r];
    const uint32_t all = lanes;
    result_ = {};
    with_path_ = 0;
    const RayPacket* met = &packet;
    for (layer_ = 0; lanes != 0; ++layer_) {
      const Lanes found = meet_all(view, *met, lanes);
      if ((found.plain | found.alone) != 0) {
        add_lights(view, found, counts, clock);
        show(view, found.plain | found.alone);
      }
      lanes = found.going;
      if (lanes == 0) break;
      if (layer_ == kMostLayers) {
        for (uint32_t left = lanes; left != 0; left &= left - 1)
          leave(view, paths_[static_cast<size_t>(std::countr_zero(left))]);
        break;
      }
      trace_on(view, lanes, counts, clock);
      met = &next_;
    }
    for (uint32_t left = with_path_; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      result_.set(r, result_.of(r) + paths_[r].light);
    }
    for (uint32_t left = all; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      light[r] = result_.rgb[channel[r]][r];
    }
    cache_ = nullptr;
  }
  /// Returns the light of a lane of the last packet that met a surface, after the tone map.
  [[nodiscard]] Vec3 light_of(size_t lane) const { return result_.of(lane); }

 private:
  /// Most surfaces that a ray passes; rays behind them see the backdrop.
  static constexpr int kMostLayers = 256;
  /// Rays of which a smaller share reaches the viewer end.
  static constexpr double kLeastWeight = 1e-4;
  /// Fraction of the distance to a light within which an occluder counts as the light itself.
  static constexpr double kLightClearance = 1.0 / (1 << 18);
  static constexpr Vec3 kOne{1, 1, 1};

  static bool is_volume(const PbrMaterial& material) {
    return material.transmission > 0.0 && material.thickness > 0.0;
  }

  /// Returns the share of light that a volume lets through along a way in world units.
  static Vec3 attenuation(const PbrMaterial& material, double way) {
    const double part = way / material.attenuation_distance;
    const auto kept = [part](double colour) {
      return std::pow(std::clamp(colour, 0.0, 1.0), part);
    };
    if (!(part > 0.0)) return kOne;
    const Vec3 colour = material.attenuation_colour;
    return {kept(colour.x), kept(colour.y), kept(colour.z)};
  }

  /// Returns the roughness of what a ray sees through a surface: the less it refracts, the less it
  /// blurs.
  static double transmitted_roughness(const PbrPoint& point) {
    return point.roughness * std::clamp(2.0 * point.ior - 2.0, 0.0, 1.0);
  }

  /// Refracts at the shading normal, or at the geometric one where the former sends the ray back.
  static std::optional<Vec3> through(const Surface& surface, Vec3 normal, Vec3 direction,
                                     double eta) {
    if (dot(direction, normal) < 0.0) {
      const auto smooth = refracted(direction, normal, eta);
      if (!smooth || dot(*smooth, surface.geometric_normal) < 0.0) return smooth;
    }
    return refracted(direction, surface.geometric_normal, eta);
  }

  /// Follows a shadow ray through everything that lets light pass; returns the share that arrives.
  static Vec3 light_arriving(const Scene& scene, Vec3 origin, Vec3 direction, double far) {
    Vec3 share{1, 1, 1};
    for (int layer = 0; layer < kMostLayers; ++layer) {
      const std::optional<Surface> surface = first_surface(scene, origin, direction, far);
      if (!surface) return share;
      share = share * scene.pbr->passed(*surface);
      if (largest(share) < kLeastWeight) return {};
      const Vec3 next = spawn_point(*surface, Side::Far);
      far -= length(next - origin);
      origin = next;
      if (far <= 0.0) return share;
    }
    return {};
  }
  /// Path is the state of one lane's ray.
  struct Path {
    Vec3 origin{};
    Vec3 direction{};                     ///< unit
    Vec3 weight{1, 1, 1};                 ///< share of the light ahead that reaches the viewer
    Vec3 light{};                         ///< light so far
    const PbrMaterial* medium = nullptr;  ///< volume that the ray is in
    double roughness = 0.0;               ///< largest, of the surfaces that transmitted the ray
    int bends = 0;
  };
  /// Met is a surface that a lane met and that is shaded alone.
  struct Met {
    Surface surface{};
    std::optional<PbrShader> shader{};  ///< empty if the surface is not lit
  };
  /// View is what all lanes of a packet share.
  struct View {
    const Scene& scene;
    const PbrScene& pbr;
    const BeamSize& beam;

    [[nodiscard]] RayFootprint footprint(Vec3 point) const {
      const double z = pbr.panel_from_scene().point(point).z;
      return {.across = scene.scene_from_panel.vector({beam.across_mm(z), 0, 0}),
              .along = scene.scene_from_panel.vector({0, beam.along_mm(z), 0})};
    }
  };
  /// Lanes are bit masks of the surfaces of one layer.
  struct Lanes {
    uint32_t plain = 0;  ///< shaded in lanes
    uint32_t alone = 0;  ///< lit and shaded one by one
    uint32_t going = 0;  ///< paths that go on behind the surface
  };

  void start_paths(const RayPacket& packet, uint32_t lanes) {
    with_path_ = lanes;
    const RTCRay16& ray = packet.rays.ray;
    for (uint32_t left = lanes; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      paths_[r] = {.origin = {double{ray.org_x[r]}, double{ray.org_y[r]}, double{ray.org_z[r]}},
                   .direction = normalized(
                       Vec3{double{ray.dir_x[r]}, double{ray.dir_y[r]}, double{ray.dir_z[r]}})};
    }
  }
  /// Returns those of `lanes` whose rays are in a volume.
  [[nodiscard]] uint32_t in_volumes(uint32_t lanes) const {
    uint32_t inside = 0;
    for (uint32_t left = lanes & with_path_; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      if (paths_[r].medium != nullptr) inside |= kLaneBit[r];
    }
    return inside;
  }
  /// Computes the light of the surfaces that plain_ has found, except that of lights.
  void meet_plain(const View& view, uint32_t lanes) {
    plain_.shade(view.scene, light_);
    for (auto& channel : weight_.rgb) std::ranges::fill(channel, 1.0F);
    for (uint32_t left = lanes & with_path_; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      weight_.set(r, paths_[r].weight * plain_.alpha(r));
    }
  }
  void record_plain(const RayPacket& packet, const PbrLanes::Found& plain) {
    if (cache_ == nullptr) return;
    for (uint32_t left = plain.all; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      note(packet, r,
           (plain.shown & kLaneBit[r]) == 0 ? Way::Unseen
           : plain_.is_outside(r)           ? Way::Front
                                            : Way::Back);
    }
  }
  /// Finds the surfaces that `lanes` met, and computes their light except that of lights.
  [[nodiscard]] Lanes meet_all(const View& view, const RayPacket& packet, uint32_t lanes) {
    const PbrLanes::Found plain =
        plain_.find(view.scene, view.beam, packet, lanes & ~in_volumes(lanes));
    const uint32_t others = lanes & ~plain.all;
    if (layer_ == 0) start_paths(packet, others | plain.passing);
    Lanes found{.plain = plain.shown};
    if (plain.shown != 0) meet_plain(view, plain.shown);
    record_plain(packet, plain);
    for (uint32_t left = plain.passing; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      paths_[r].weight = paths_[r].weight * (1.0 - plain_.alpha(r));
      if (pass(plain_.behind(r), paths_[r])) found.going |= kLaneBit[r];
    }
    uint32_t lit = 0;
    for (uint32_t left = others; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      met_[r].shader.reset();
      switch (meet(view, packet, r)) {
        case Next::End:
          break;
        case Next::Pass:
          found.going |= kLaneBit[r];
          break;
        case Next::Shade:
          lit |= kLaneBit[r];
          break;
      }
    }
    while (lit != 0) lit &= ~meet_mesh(view, packet, lit, found);
    return found;
  }
  /// Shades the first of `lanes`, and those that met the same mesh, since these share look-ups of
  /// textures. Returns these lanes.
  uint32_t meet_mesh(const View& view, const RayPacket& packet, uint32_t lanes, Lanes& found) {
    const MeshShape* mesh = met_[static_cast<size_t>(std::countr_zero(lanes))].surface.mesh;
    LaneTextures& textures = plain_.textures();
    textures.start(mesh);
    uint32_t same = 0;
    for (uint32_t left = lanes; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      const Surface& surface = met_[r].surface;
      if (surface.mesh != mesh) continue;
      same |= kLaneBit[r];
      textures.add(
          r, place_of(view.scene, surface, paths_[r].direction, view.footprint(surface.point)));
    }
    for (uint32_t left = same; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      InputReader reader(view.scene, textures.place(r), &textures, r);
      const PbrSurface shaded =
          view.pbr.surface(met_[r].surface, paths_[r].direction, textures.place(r), reader);
      if (shade_alone(view, packet, r, shaded)) found.going |= kLaneBit[r];
      if (met_[r].shader) found.alone |= kLaneBit[r];
    }
    return same;
  }
  /// Adds the light of a layer, after the tone map, to the paths.
  void show(const View& view, uint32_t lanes) {
    ColourLanes shown;
    plain_.tone_map(view.pbr.tone_map(), light_, shown);
    for (size_t c = 0; c < 3; ++c)
      for (size_t r = 0; r < kPacket; ++r)
        result_.rgb[c][r] +=
            (lanes & kLaneBit[r]) != 0 ? weight_.rgb[c][r] * shown.rgb[c][r] : 0.0F;
  }
  /// Next tells how a path goes on at the surface that a lane met.
  enum class Next { End, Pass, Shade };
  /// Finds the surface.
  Next meet(const View& view, const RayPacket& packet, size_t lane) {
    const auto next = [](bool passes) { return passes ? Next::Pass : Next::End; };
    Path& path = paths_[lane];
    const RTCRay16& ray = packet.rays.ray;
    if (packet.rays.hit.geomID[lane] == RTC_INVALID_GEOMETRY_ID) {
      leave(view, path);
      return Next::End;
    }
    const double stretch =
        length(Vec3{double{ray.dir_x[lane]}, double{ray.dir_y[lane]}, double{ray.dir_z[lane]}});
    Met& met = met_[lane];
    met.surface = surface_at(view.scene, {.origin = path.origin, .direction = path.direction},
                             {.geometry = packet.rays.hit.geomID[lane],
                              .primitive = packet.rays.hit.primID[lane],
                              .distance = static_cast<float>(double{ray.tfar[lane]} * stretch)});
    const Surface& surface = met.surface;
    const PbrMaterial& material = *surface.material->pbr;
    if (path.medium != nullptr)
      path.weight = path.weight * attenuation(*path.medium, length(surface.point - path.origin) /
                                                                view.scene.frame.units_per_world);
    if (!surface.outer_side && is_volume(material) && path.medium != nullptr)
      return next(exit(view, packet, lane));
    if (!surface.outer_side && !material.double_sided) {
      note(packet, lane, Way::Unseen);
      return next(pass(surface, path));
    }
    return Next::Shade;
  }
  /// Computes the light of the surface except that of lights. Returns false if the path ends there.
  bool shade_alone(const View& view, const RayPacket& packet, size_t lane,
                   const PbrSurface& shaded) {
    Path& path = paths_[lane];
    Met& met = met_[lane];
    const Surface& surface = met.surface;
    const PbrMaterial& material = *shaded.material;
    const double alpha = shaded.point.alpha;
    note(packet, lane, alpha == 0.0 ? Way::Unseen : surface.outer_side ? Way::Front : Way::Back);
    if (alpha == 0.0) return pass(surface, path);
    const Vec3 weight = path.weight * alpha;
    if (material.unlit) {
      path.light += weight * shaded.point.colour;
      path.weight = path.weight * (1.0 - alpha);
      return pass(surface, path);
    }
    const PbrShader& shader = met.shader.emplace(shaded.point);
    light_.set(lane,
               shader.emitted() + shader.of_environment(view.pbr.environment(), view.pbr.frame()));
    weight_.set(lane, weight);
    const Vec3 through = shader.transmitted() * alpha;
    path.weight = path.weight * (through + kOne * (1.0 - alpha));
    if (largest(through) > 0.0)
      path.roughness = std::max(path.roughness, transmitted_roughness(shaded.point));
    // A ray cannot go both straight on and bent: partly transparent surfaces do not refract.
    const bool bends = shaded.thickness > 0.0 && alpha == 1.0 && surface.outer_side;
    return bends ? enter(view, surface, shaded, path) : pass(surface, path);
  }
  // Each moves a path on from a surface, and returns false if the path ends.

  [[nodiscard]] static bool pass(Vec3 start, Path& path) {
    if (largest(path.weight) < kLeastWeight) return false;
    path.origin = start;
    return true;
  }
  [[nodiscard]] static bool pass(const Surface& surface, Path& path) {
    return pass(spawn_point(surface, Side::Far), path);
  }
  [[nodiscard]] bool enter(const View& view, const Surface& surface, const PbrSurface& shaded,
                           Path& path) const {
    path.medium = shaded.material;
    return bend(view, surface,
                through(surface, shaded.point.normal, path.direction,
                        1.0 / std::max(shaded.material->ior, 1e-3)),
                path);
  }
  /// All light leaves a volume, or none where it is mirrored totally: as in viewers, what the inner
  /// side mirrors is left out.
  [[nodiscard]] bool exit(const View& view, const RayPacket& packet, size_t lane) {
    const Surface& surface = met_[lane].surface;
    Path& path = paths_[lane];
    const auto out =
        through(surface, surface.shading_normal, path.direction, std::max(path.medium->ior, 1e-3));
    note(packet, lane, out ? Way::Left : Way::Mirrored);
    if (out) path.medium = nullptr;
    return bend(view, surface, out, path);
  }
  [[nodiscard]] bool bend(const View& view, const Surface& surface, std::optional<Vec3> through,
                          Path& path) const {
    const Vec3 normal = surface.geometric_normal;
    if (largest(path.weight) < kLeastWeight) return false;
    path.origin = spawn_point(surface, through ? Side::Far : Side::Viewer);
    path.direction =
        through ? *through
                : normalized(path.direction - normal * (2.0 * dot(path.direction, normal)));
    if (path.bends++ < most_bends_) return true;
    leave(view, path);
    return false;
  }
  static void leave(const View& view, Path& path) {
    path.light += path.weight * view.pbr.backdrop(path.origin, path.direction, path.roughness);
  }
  /// Way is the event that a ray had at a surface; it becomes part of the path id.
  enum class Way : uint32_t { Unseen, Front, Back, Left, Mirrored };
  void note(const RayPacket& packet, size_t lane, Way way) {
    if (cache_ == nullptr) return;
    cache_->record_surface(bounce(), lane, packet.rays.hit.geomID[lane],
                           packet.rays.hit.primID[lane], static_cast<uint32_t>(way));
  }
  [[nodiscard]] LightCache::Bounce bounce() const {
    return {.path = static_cast<uint32_t>(layer_) + 1, .is_first = layer_ == 0};
  }
  /// Traces the rays of `lanes` on.
  void trace_on(const View& view, uint32_t lanes, FrameCounts& counts, WorkClock& clock) {
    for (size_t r = 0; r < kPacket; ++r) {
      const bool wanted = (lanes & kLaneBit[r]) != 0;
      const bool fit = wanted && fit_for_embree(paths_[r].origin, paths_[r].direction);
      if (wanted && !fit) ++counts.invalid_rays;
      next_.valid[r] = fit ? -1 : 0;
      set_lane(next_, r, fit ? Vec3f(paths_[r].origin) : Vec3f{},
               fit ? Vec3f(paths_[r].direction) : Vec3f{0, 0, 1});
      next_.rays.hit.geomID[r] = RTC_INVALID_GEOMETRY_ID;
    }
    counts.secondary_rays += count_lanes(next_.valid);
    clock.turn_to(Work::TraceSecondary);
    intersect16(next_.valid, view.scene.embree, next_.rays, Coherence::Coherent);
    clock.turn_to(Work::Shade);
  }
  void add_lights(const View& view, const Lanes& lanes, FrameCounts& counts, WorkClock& clock) {
    for (size_t light = 0; light < view.scene.lights.size(); ++light) {
      make_shadow_rays(view, light, lanes, counts);
      arriving_ = {};
      const uint32_t wanted = lane_bits(shadow_valid_);
      const uint32_t known =
          cache_ != nullptr ? cache_->take_known(bounce(), light, shadow_valid_) : 0;
      trace_shadows(view, counts, clock);
      for (uint32_t left = known; left != 0; left &= left - 1)
        arriving_.set(static_cast<size_t>(std::countr_zero(left)), kOne);
      for (size_t c = 0; c < 3; ++c)
        for (size_t r = 0; r < kPacket; ++r)
          light_.rgb[c][r] +=
              (wanted & kLaneBit[r]) != 0 ? brings_.rgb[c][r] * arriving_.rgb[c][r] : 0.0F;
      if (cache_ != nullptr) record_shadows(light, wanted);
    }
  }
  /// Sets shadow_ and brings_ for a light.
  void make_shadow_rays(const View& view, size_t light, const Lanes& lanes, FrameCounts& counts) {
    if (lanes.plain != 0)
      plain_.light_rays(view.scene, light, shadow_, shadow_valid_, brings_, counts);
    else
      std::fill_n(shadow_valid_, kPacket, 0);
    for (uint32_t left = lanes.alone; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      brings_.set(r, shadow_ray(view, light, r, counts));
    }
  }
  /// Notes which lanes the light reaches. Where a part of it arrives, the light values themselves
  /// tell how much.
  void record_shadows(size_t light, uint32_t wanted) {
    std::array<float, kPacket> most{};
    uint32_t all = 0, none = 0;
    for (uint32_t left = wanted; left != 0; left &= left - 1) {
      const auto r = static_cast<size_t>(std::countr_zero(left));
      most[r] = static_cast<float>(largest(weight_.of(r) * brings_.of(r)));
      if (arriving_.of(r) == kOne) all |= kLaneBit[r];
      if (arriving_.of(r) == Vec3{}) none |= kLaneBit[r];
    }
    cache_->record_shadows(bounce(), light, most.data(), all | none, all);
    cache_->record_partly(bounce(), light, wanted & ~(all | none));
  }
  /// Sets the shadow ray of a lane toward a light. Returns the light that it brings if unoccluded;
  /// zero if there is no ray.
  Vec3 shadow_ray(const View& view, size_t light, size_t lane, FrameCounts& counts) {
    const Met& met = met_[lane];
    shadow_valid_[lane] = 0;
    shadow_.org_x[lane] = shadow_.org_y[lane] = shadow_.org_z[lane] = 0.0F;
    shadow_.dir_x[lane] = shadow_.dir_y[lane] = 0.0F;
    shadow_.dir_z[lane] = 1.0F;
    shadow_.tfar[lane] = 0.0F;
    const Vec3 start = spawn_point(met.surface, Side::Viewer);
    const Arrival at =
        arrival(view.pbr.unit_lights()[light], start, view.scene.frame.units_per_world, 0);
    if (at.intensity == 0.0) return {};
    const Vec3 brings =
        view.scene.lights[light].colour * met.shader->of_light(at.toward_light) * at.intensity;
    if (brings == Vec3{}) return {};
    if (!fit_for_embree(start, at.toward_light)) {
      ++counts.invalid_rays;
      return {};
    }
    const Vec3f from(start), direction(at.toward_light);
    shadow_valid_[lane] = -1;
    shadow_.org_x[lane] = from.x;
    shadow_.org_y[lane] = from.y;
    shadow_.org_z[lane] = from.z;
    shadow_.dir_x[lane] = direction.x;
    shadow_.dir_y[lane] = direction.y;
    shadow_.dir_z[lane] = direction.z;
    shadow_.tfar[lane] = static_cast<float>(at.distance * (1.0 - kLightClearance));
    return brings;
  }
  /// Sets the share of the light that arrives along each shadow ray.
  void trace_shadows(const View& view, FrameCounts& counts, WorkClock& clock) {
    if (!any_lane(shadow_valid_)) return;
    counts.shadow_rays += count_lanes(shadow_valid_);
    clock.turn_to(Work::TraceShadows);
    if (view.pbr.any_passes()) {
      for (size_t r = 0; r < kPacket; ++r)
        if (shadow_valid_[r] != 0)
          arriving_.set(
              r, light_arriving(
                     view.scene,
                     {double{shadow_.org_x[r]}, double{shadow_.org_y[r]}, double{shadow_.org_z[r]}},
                     {double{shadow_.dir_x[r]}, double{shadow_.dir_y[r]}, double{shadow_.dir_z[r]}},
                     double{shadow_.tfar[r]}));
    } else {
      occluded16(shadow_valid_, view.scene.embree, shadow_, Coherence::Coherent);
      for (auto& channel : arriving_.rgb)
        for (size_t r = 0; r < kPacket; ++r)
          channel[r] = shadow_valid_[r] != 0 && shadow_.tfar[r] >= 0.0F ? 1.0F : 0.0F;
    }
    clock.turn_to(Work::Shade);
  }

  int most_bends_;
  LightCache* cache_ = nullptr;  ///< cache of the packet that is being shaded
  int layer_ = 0;                ///< surfaces that its rays have passed
  std::array<Path, kPacket> paths_;
  uint32_t with_path_ = 0;  ///< lanes of the packet whose state is in `paths_`
  std::array<Met, kPacket> met_;
  PbrLanes plain_;
  ColourLanes light_{};     ///< light of this layer's surfaces, before the tone map
  ColourLanes weight_{};    ///< shares of it that reach the viewer
  ColourLanes brings_{};    ///< light of the shadow rays if unoccluded
  ColourLanes arriving_{};  ///< share of it that arrives
  ColourLanes result_{};    ///< light of the rays, without that of `paths_`
  RayPacket next_;
  RTCRay16 shadow_;
  alignas(64) int shadow_valid_[kPacket];
};

/// Throws Error(Usage) for options of sampled light, which metallic-roughness materials do not
/// support.
inline void require_supported(const Scene& scene, const RenderOptions& options) {
  if (scene.pbr == nullptr || !options.soft.any()) return;
  throw Error(ErrorKind::Usage,
              "--soft-shadows, --occlusion, --environment-light: not supported for "
              "metallic-roughness materials",
              "render without them: studio, sky or environment picture light such materials from "
              "all sides");
}

}  // namespace lenticule::render
