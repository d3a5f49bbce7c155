// SPDX-License-Identifier: Apache-2.0
// Records of the light that a packet's lanes receive: LightNotes, taken while a packet is traced,
// and KnownLight, which saves rays when other packets are shaded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "render/accel/ray_stream.h"
#include "render/shading/soft_shader.h"

namespace lenticule::render {

/// LightNotes are the path records of the lanes of a packet.
struct LightNotes {
  /// Number of area lights whose visible shares are recorded.
  static constexpr size_t kAreaLights = 8;
  static constexpr float kNoShare = -1.0F;

  /// Path ids: hashes of the surfaces met and of the lights hidden from them, as far as those can
  /// matter. Equal ids mean that nothing differs. `way` covers the ray itself, `secondary_way`
  /// its mirrored and refracted rays.
  alignas(64) uint32_t way[kPacket];
  alignas(64) uint32_t secondary_way[kPacket];
  /// Light of the secondary rays; part of the lane's light.
  alignas(64) float secondary[kPacket];
  /// A bit for each of the first 32 lights: `lit` if the light shines on the surface that the
  /// primary ray met, `hidden` if it is occluded. Neither bit is set if the light is behind the
  /// surface. For an area light: entirely visible, entirely hidden, or neither.
  alignas(64) uint32_t lit[kPacket];
  alignas(64) uint32_t hidden[kPacket];
  /// Unoccluded share of the hemisphere, if ambient occlusion is sampled; kNoShare on surfaces
  /// that reflect no ambient light.
  alignas(64) float around[kPacket];
  /// Visible shares of the first area lights, per lane; kNoShare if the light cannot shine on the
  /// lane's surface anyway.
  alignas(64) float seen[kAreaLights][kPacket];
};

/// KnownLight holds the results for sixteen rays that need not be traced again.
struct KnownLight {
  static constexpr size_t kLights = 32;  ///< number of lights covered, starting with the first
  uint32_t lit[kLights];                 ///< bits of the lanes on which a light shines, by light,
  uint32_t hidden[kLights];              ///< and for each lane from which the light is hidden
  uint32_t secondary_lanes;  ///< lanes whose mirrored and refracted rays contribute `secondary`
  alignas(64) float secondary[kPacket];
  KnownShare around;                         ///< see LightNotes
  KnownShare seen[LightNotes::kAreaLights];  ///< see LightNotes; used if area lights are integrated

  /// Sets `lit` and `hidden` from a bit mask of lights per lane, as in LightNotes.
  void set_lights(std::span<const uint32_t, kPacket> shining,
                  std::span<const uint32_t, kPacket> not_seen);
};

}  // namespace lenticule::render
