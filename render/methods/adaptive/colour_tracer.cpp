// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/colour_tracer.h"

#include <algorithm>
#include <array>

namespace lenticule::render {
namespace {

/// The path of the light is recorded for green, which dominates perceived brightness.
constexpr int kFirst = 1;
constexpr int kOthers[] = {0, 2};

/// Returns the lights that reach the surfaces, which are the same in all colours.
KnownLight lights_of(const LightNotes& notes) {
  KnownLight known{};
  known.set_lights(notes.lit, notes.hidden);
  return known;
}

}  // namespace

void ColourTracer::trace(const Scene& scene, const SurfaceGroups& groups, float noticed,
                         RayPacket& packet, Colours& out) {
  const auto light = [&](int c) { return std::span<float, kPacket>(out.light[c], kPacket); };
  std::array<int32_t, kPacket> channel;
  channel.fill(kFirst);
  tracer_.trace_noting(scene, plan_, channel, groups, noticed, packet, light(kFirst));
  out.notes = tracer_.notes();
  std::copy_n(out.notes.secondary, kPacket, out.secondary[kFirst]);
  const KnownLight known = lights_of(out.notes);
  for (const int c : kOthers) {
    if (scene.pbr != nullptr) {  // traced in all channels at once
      std::ranges::copy(tracer_.pbr_light(packet, c), out.light[c]);
      std::copy_n(out.secondary[kFirst], kPacket, out.secondary[c]);
      continue;
    }
    channel.fill(c);
    tracer_.trace_known(scene, plan_, channel, known, packet, light(c), true);
    std::copy_n(tracer_.notes().secondary, kPacket, out.secondary[c]);
  }
  for (size_t r = 0; r < kPacket; ++r) {
    const uint32_t geometry = packet.rays.hit.geomID[r];
    const bool met = packet.valid[r] != 0 && geometry != RTC_INVALID_GEOMETRY_ID;
    out.group[r] = met ? groups.of(geometry, packet.rays.hit.primID[r]) : SurfaceGroups::kNothing;
  }
}

}  // namespace lenticule::render
