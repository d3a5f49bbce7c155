// SPDX-License-Identifier: Apache-2.0
// PbrLanes shades a packet's points on plain metallic-roughness materials, sixteen at a time.
#pragma once

#include <cstdint>

#include "render/accel/ray_stream.h"
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

}  // namespace lenticule::render
