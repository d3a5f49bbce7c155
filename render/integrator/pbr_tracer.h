// SPDX-License-Identifier: Apache-2.0
// PbrTracer follows the rays of a packet through a scene with metallic-roughness materials: through
// surfaces that are cut out, blended or transmit light, until they end. It computes three channels
// per ray, since a tone map needs them all.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "render/accel/ray_stream.h"
#include "render/integrator/light_memory.h"
#include "render/options/frame_counts.h"
#include "render/options/render_options.h"
#include "render/options/work_clock.h"
#include "render/rays/tile.h"
#include "render/scene/scene.h"
#include "render/shading/pbr_scene.h"

namespace lenticule::render {

/// PbrTracer serves one packet at a time. Thread safety: used by one thread.
class PbrTracer {
 public:
  /// `max_depth` as in RenderOptions: rays that are refracted more often see the backdrop.
  explicit PbrTracer(int max_depth);

  /// Shades the lanes of a packet that met a surface, and writes their light after the tone map, in
  /// channel[r], to light[r]; other elements of `light` are unchanged. `memory` notes the paths and
  /// knows lights already, unless it is null. The calling thread must flush denormals.
  void shade(const Scene& scene, const BeamSize& beam, std::span<const int32_t, kPacket> channel,
             const RayPacket& packet, std::span<float, kPacket> light, LightMemory* memory,
             FrameCounts& counts, WorkClock& clock);
  /// Returns the light of a lane of the last packet that met a surface, after the tone map.
  [[nodiscard]] Vec3 light_of(size_t lane) const { return paths_[lane].light; }

 private:
  /// Path is the state of one lane's ray.
  struct Path {
    Vec3 origin{};
    Vec3 direction{};                     ///< unit
    Vec3 weight{1, 1, 1};                 ///< share of the light ahead that reaches the viewer
    Vec3 light{};                         ///< light so far
    const PbrMaterial* medium = nullptr;  ///< volume that the ray is in
    double roughness = 0.0;               ///< of the surfaces that transmitted the ray
    int bends = 0;
  };
  /// Lit is a surface that a lane met, with its light so far.
  struct Lit {
    Surface surface{};
    uint32_t geometry = 0, primitive = 0;  ///< Embree's numbers
    std::optional<PbrShader> shader{};     ///< empty if the surface is not lit
    Vec3 light{};                          ///< before the tone map
    Vec3 weight{};
  };
  struct View;

  /// Computes the surface that a lane met, and its light except that of lights. Returns false if
  /// the path ends there.
  bool meet(const View& view, const RayPacket& packet, size_t lane);
  // Each moves a path on from a surface, and returns false if the path ends.

  [[nodiscard]] static bool pass(const Surface& surface, Path& path);
  [[nodiscard]] bool enter(const View& view, const Surface& surface, const PbrSurface& shaded,
                           Path& path) const;
  [[nodiscard]] bool exit(const View& view, size_t lane);
  [[nodiscard]] bool bend(const View& view, const Surface& surface, std::optional<Vec3> through,
                          Path& path) const;
  static void leave(const View& view, Path& path);
  /// What became of a ray at a surface, for the path ids.
  enum class Met : uint32_t { Unseen, Front, Back, Left, Mirrored };
  void note(size_t lane, Met met);
  [[nodiscard]] LightMemory::Bounce bounce() const;
  /// Traces the rays of `lanes` on.
  void trace_on(const View& view, uint32_t lanes, FrameCounts& counts, WorkClock& clock);
  void add_lights(const View& view, FrameCounts& counts, WorkClock& clock);
  void note_shadows(size_t light, uint32_t wanted, std::span<const Vec3, kPacket> brings);
  /// Sets the shadow ray of a lane toward a light. Returns the light that it brings if unoccluded;
  /// zero if there is no ray.
  Vec3 shadow_ray(const View& view, size_t light, size_t lane, FrameCounts& counts);
  /// Sets the share of the light that arrives along each shadow ray.
  void trace_shadows(const View& view, FrameCounts& counts, WorkClock& clock);

  int most_bends_;
  LightMemory* memory_ = nullptr;  ///< of the packet that is being shaded
  int layer_ = 0;                  ///< surfaces that its rays have passed
  std::array<Path, kPacket> paths_;
  std::array<Lit, kPacket> lit_;
  RayPacket next_;
  RTCRay16 shadow_;
  alignas(64) int shadow_valid_[kPacket];
  std::array<Vec3, kPacket> arriving_;
};

/// Throws Error(Usage) for options of sampled light, which metallic-roughness materials do not
/// support.
void require_supported(const Scene& scene, const RenderOptions& options);

}  // namespace lenticule::render
