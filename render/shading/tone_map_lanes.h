// SPDX-License-Identifier: Apache-2.0
// The tone maps of render/scene/tone_map.h for the lanes of a packet, for kernels that are compiled
// once per instruction set.
#pragma once

#include "render/shading/packet_kernel_lanes.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

inline Floats largest_of(const Floats3& v) {
  return max(max(v.x, v.y), v.z);
}
inline Floats smallest_of(const Floats3& v) {
  return min(min(v.x, v.y), v.z);
}
inline Floats3 all(const Floats& v) {
  return {v, v, v};
}

inline Floats3 pbr_neutral(const Floats3& light) {
  constexpr float kFloor = 0.04F;
  constexpr float kStart = 0.8F - kFloor;
  constexpr float kDesaturation = 0.15F;
  constexpr float kRoom = 1.0F - kStart;
  const Floats low = smallest_of(light);
  const Floats floor =
      select(low < 2.0F * kFloor, low - low * low * (0.25F / kFloor), Floats::of(kFloor));
  const Floats3 lowered = light - all(floor);
  const Floats peak = largest_of(lowered);
  const Masks bright = ~(peak < kStart);
  if (!any(bright)) return lowered;
  const Floats shown = 1.0F - kRoom * kRoom / (peak + (kRoom - kStart));
  const Floats kept = 1.0F / (kDesaturation * (peak - shown) + 1.0F);
  const Floats3 compressed = lowered * (shown / peak * kept) + all(shown * (1.0F - kept));
  return select(bright, compressed, lowered);
}

/// Returns the product with a matrix, of which these are the columns.
inline Floats3 product(const float (&columns)[3][3], const Floats3& v) {
  return spread(columns[0]) * v.x + spread(columns[1]) * v.y + spread(columns[2]) * v.z;
}

inline Floats aces_curve(const Floats& v) {
  return (v * (v + 0.0245786F) - 0.000090537F) / (v * (0.983729F * v + 0.4329510F) + 0.238081F);
}

inline Floats3 aces(const Floats3& light) {
  constexpr float kIn[3][3] = {{0.59719F, 0.07600F, 0.02840F},
                               {0.35458F, 0.90834F, 0.13383F},
                               {0.04823F, 0.01566F, 0.83777F}};
  constexpr float kOut[3][3] = {{1.60475F, -0.10208F, -0.00327F},
                                {-0.53108F, 1.10813F, -0.07276F},
                                {-0.07367F, -0.00605F, 1.07602F}};
  constexpr float kExposure = 1.0F / 0.6F;
  const Floats3 in = product(kIn, light * Floats::of(kExposure));
  const Floats3 out = product(kOut, {aces_curve(in.x), aces_curve(in.y), aces_curve(in.z)});
  return {clamp01(out.x), clamp01(out.y), clamp01(out.z)};
}

}  // namespace
}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
