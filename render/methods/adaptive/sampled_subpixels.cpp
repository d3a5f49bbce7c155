// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/sampled_subpixels.h"

#include <algorithm>

#include "base/error.h"

namespace lenticule::render {

SampledSubpixels::SampledSubpixels(const PrimaryPackets& packets, const TilePlan& plan,
                                   const Footprint& centre)
    : plan_(plan), centre_(centre), maker_(packets), packet_(1) {
  init_packets(packet_);
}

void SampledSubpixels::trace(const Scene& scene, int first_row, PacketTracer& tracer) {
  std::ranges::sort(subpixels_, {}, [&](const Subpixel& s) { return std::pair(column(s), s.row); });
  const int first_tile = first_row / TilePlan::kRows * plan_.per_band();
  int tiles_begun = 0;
  Tile tile{};
  size_t in_packet = 0;
  for (size_t n = 0; n < subpixels_.size(); ++n) {
    const Subpixel& s = subpixels_[n];
    while (tiles_begun == 0 || column(s) >= tile.column_begin + tile.columns) {
      LENTICULE_CHECK(tiles_begun < plan_.per_band());
      tile = plan_.tile(first_tile + tiles_begun++);
      if (column(s) < tile.column_begin + tile.columns) maker_.start_few(scene, tile, centre_);
    }
    maker_.ray(column(s) - tile.column_begin, s.row, packet_[0], in_packet++);
    if (in_packet < kPacket && n + 1 < subpixels_.size()) continue;
    trace_packet(scene, first_row, n + 1 - in_packet, n + 1, tracer);
    in_packet = 0;
  }
}

/// Traces a packet; inactive lanes repeat the first.
void SampledSubpixels::trace_packet(const Scene& scene, int first_row, size_t first, size_t end,
                                    PacketTracer& tracer) {
  for (size_t r = 0; r < kPacket; ++r) {
    const bool there = first + r < end;
    const Subpixel& s = subpixels_[there ? first + r : first];
    packet_[0].valid[r] = there ? -1 : 0;
    channel_[r] = s.at % 3;
    seeds_[r] = sampling::subpixel_seed(first_row + s.row, s.at, 0);
  }
  if (tracer.needs_seeds()) tracer.set_seeds(seeds_);
  tracer.trace_lanes(scene, plan_, channel_, packet_[0], light_);
  for (size_t n = first; n < end; ++n) subpixels_[n].light = light_[n - first];
}

}  // namespace lenticule::render
