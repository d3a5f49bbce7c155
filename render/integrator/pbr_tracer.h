// SPDX-License-Identifier: Apache-2.0
// PbrTracer follows the rays of a packet through a scene with metallic-roughness materials: through
// surfaces that are cut out, blended or transmit light, until they end. It computes three channels
// per ray, since a tone map needs them all. Points on most materials are shaded in lanes, all
// others one by one.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "render/accel/ray_stream.h"
#include "render/integrator/light_cache.h"
#include "render/options/render_options.h"
#include "render/rays/primary_rays.h"
#include "render/scene/scene.h"
#include "render/shading/pbr_scene.h"

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
  /// Finds the points of those of `lanes` whose material is a base, a mirror and at most a coat.
  Found find(const Scene& scene, const BeamSize& beam, const RayPacket& packet, uint32_t lanes);
  /// Returns the share of the light that a point does not let pass.
  [[nodiscard]] double alpha(size_t lane) const { return double{points_.alpha[lane]}; }
  /// Returns the start of a ray that goes on behind a point.
  [[nodiscard]] Vec3 behind(size_t lane) const;
  /// Returns true if a lane met the outer side of its surface.
  [[nodiscard]] bool is_outside(size_t lane) const { return surfaces_.outer_side[lane] != 0; }
  /// Returns the light of the environment that the points reflect, and what they emit. Other lanes
  /// are unspecified.
  void shade(const Scene& scene, ColourLanes& light);
  /// Makes rays toward a light from the points it can shine on, harmless rays in all other lanes.
  /// `brings` is the light that each adds if unoccluded.
  void light_rays(const Scene& scene, size_t light, RTCRay16& rays, int* valid, ColourLanes& brings,
                  FrameCounts& counts) const;
  void tone_map(ToneMap map, const ColourLanes& light, ColourLanes& shown) const;

 private:
  void apply_textures(const Scene& scene, const RayPacket& packet, size_t lane);

  void apply_coat_textures(const PbrMaterial& material, const MaterialInputs& inputs, double side,
                           InputReader& reader, size_t lane);

  const pbr_kernel::Kernel& kernel_;
  shading_kernel::Surfaces surfaces_{};
  pbr_kernel::Points points_{};
  pbr_kernel::Shaded shaded_{};
};

/// PbrTracer serves one packet at a time. Thread safety: used by one thread.
class PbrTracer {
 public:
  /// `max_depth` as in RenderOptions: rays that are refracted more often see the backdrop.
  PbrTracer(int max_depth, Isa isa);

  /// Shades the lanes of a packet that met a surface, and writes their light after the tone map, in
  /// channel[r], to light[r]; other elements of `light` are unchanged. `cache` notes the paths and
  /// knows lights already, unless it is null. The calling thread must flush denormals.
  void shade(const Scene& scene, const BeamSize& beam, std::span<const int32_t, kPacket> channel,
             const RayPacket& packet, std::span<float, kPacket> light, LightCache* cache,
             FrameCounts& counts, WorkClock& clock);
  /// Returns the light of a lane of the last packet that met a surface, after the tone map.
  [[nodiscard]] Vec3 light_of(size_t lane) const { return result_.of(lane); }

 private:
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
  struct View;
  /// Lanes are bit masks of the surfaces of one layer.
  struct Lanes {
    uint32_t plain = 0;  ///< shaded in lanes
    uint32_t alone = 0;  ///< lit and shaded one by one
    uint32_t going = 0;  ///< paths that go on behind the surface
  };

  void start_paths(const RayPacket& packet, uint32_t lanes);
  /// Returns those of `lanes` whose rays are in a volume.
  [[nodiscard]] uint32_t in_volumes(uint32_t lanes) const;
  /// Computes the light of the surfaces that plain_ has found, except that of lights.
  void meet_plain(const View& view, uint32_t lanes);
  void record_plain(const RayPacket& packet, const PbrLanes::Found& plain);
  /// Finds the surfaces that `lanes` met, and computes their light except that of lights.
  [[nodiscard]] Lanes meet_all(const View& view, const RayPacket& packet, uint32_t lanes);
  /// Adds the light of a layer, after the tone map, to the paths.
  void show(const View& view, uint32_t lanes);
  /// Computes the surface that a lane met, and its light except that of lights. Returns false if
  /// the path ends there.
  bool meet(const View& view, const RayPacket& packet, size_t lane);
  // Each moves a path on from a surface, and returns false if the path ends.

  [[nodiscard]] static bool pass(Vec3 start, Path& path);
  [[nodiscard]] static bool pass(const Surface& surface, Path& path);
  [[nodiscard]] bool enter(const View& view, const Surface& surface, const PbrSurface& shaded,
                           Path& path) const;
  [[nodiscard]] bool exit(const View& view, const RayPacket& packet, size_t lane);
  [[nodiscard]] bool bend(const View& view, const Surface& surface, std::optional<Vec3> through,
                          Path& path) const;
  static void leave(const View& view, Path& path);
  /// Way is the event that a ray had at a surface; it becomes part of the path id.
  enum class Way : uint32_t { Unseen, Front, Back, Left, Mirrored };
  void note(const RayPacket& packet, size_t lane, Way way);
  [[nodiscard]] LightCache::Bounce bounce() const;
  /// Traces the rays of `lanes` on.
  void trace_on(const View& view, uint32_t lanes, FrameCounts& counts, WorkClock& clock);
  void add_lights(const View& view, const Lanes& lanes, FrameCounts& counts, WorkClock& clock);
  /// Sets shadow_ and brings_ for a light.
  void make_shadow_rays(const View& view, size_t light, const Lanes& lanes, FrameCounts& counts);
  void record_shadows(size_t light, uint32_t wanted);
  /// Sets the shadow ray of a lane toward a light. Returns the light that it brings if unoccluded;
  /// zero if there is no ray.
  Vec3 shadow_ray(const View& view, size_t light, size_t lane, FrameCounts& counts);
  /// Sets the share of the light that arrives along each shadow ray.
  void trace_shadows(const View& view, FrameCounts& counts, WorkClock& clock);

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
void require_supported(const Scene& scene, const RenderOptions& options);

}  // namespace lenticule::render
