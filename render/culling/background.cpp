// SPDX-License-Identifier: Apache-2.0
#include "render/culling/background.h"

#include <algorithm>
#include <bit>

#include "render/accel/lane_masks.h"
#include "render/rays/packet_backdrop.h"
#include "render/scene/texture.h"

namespace lenticule::render {
namespace {

constexpr int kFewPackets = 8;

int channel_at(const TilePlan& plan, const Tile& tile, int column, int row) {
  // Subpixels to the left of the panel have negative numbers.
  return (plan.subpixel(tile, column, row) % 3 + 3) % 3;
}

void fill_flat(const Scene& scene, const TilePlan& plan, const Tile& tile, ColumnRange columns,
               float weight, std::span<float> light) {
  for (int row = 0; row < TilePlan::kRows; ++row) {
    float* out = light.data() + static_cast<size_t>(row * tile.columns);
    for (int first = columns.begin; first < columns.begin + 3; ++first) {
      const int channel = channel_at(plan, tile, first, row);
      const float more = weight * static_cast<float>(component(scene.backdrop.colour, channel));
      for (int column = first; column < columns.end; column += 3) out[column] += more;
    }
  }
}

/// Returns true if all rays of the columns see the colour of the backdrop.
bool sees_one_light(const Scene& scene, const PrimaryPackets::Maker& maker, ColumnRange columns) {
  Beam beam;
  return scene.backdrop.flat() || (scene.backdrop.ground_shadow && maker.beam(columns, beam) &&
                                   misses_ground_shadow(scene, beam));
}

}  // namespace

Background::Background() : packets_(kFewPackets) {
  static_assert(kPartColumns % kFewPackets == 0);
  init_packets(packets_);
}

void Background::add_run(Run run) {
  if (run_count_ > 0 && runs_[run_count_ - 1].empty == run.empty)
    runs_[run_count_ - 1].columns.end = run.columns.end;
  else
    runs_[run_count_++] = run;
}

std::span<const Background::Run> Background::runs(const BeamTester& tester,
                                                  const PrimaryPackets::Maker& maker) {
  run_count_ = 0;
  const Run whole{{0, TilePlan::kColumns}, false};
  std::array<Beam, kParts> beams;
  Beam all;
  bool known = tester.usable();
  for (int p = 0; p < kParts && known; ++p) {
    Beam& beam = beams[static_cast<size_t>(p)];
    known = maker.beam({p * kPartColumns, (p + 1) * kPartColumns}, beam);
    all.extend(beam);
  }
  if (!known) {
    add_run(whole);
  } else if (tester.empty(all)) {
    add_run({whole.columns, true});
  } else {
    for (int p = 0; p < kParts; ++p)
      add_run({{p * kPartColumns, (p + 1) * kPartColumns},
               tester.empty(beams[static_cast<size_t>(p)])});
  }
  return {runs_.data(), run_count_};
}

void Background::fill(const Scene& scene, const TilePlan& plan, const Tile& tile,
                      ColumnRange columns, double weight, PrimaryPackets::Maker& maker,
                      std::span<float> light) {
  filled_ += maker.count(columns);
  const auto each = static_cast<float>(weight);
  if (sees_one_light(scene, maker, columns))
    return fill_flat(scene, plan, tile, columns, each, light);
  maker.prepare(packets_);
  for (int first = columns.begin; first < columns.end; first += kPartColumns) {
    const ColumnRange part{first, std::min(first + kPartColumns, columns.end)};
    if (sees_one_light(scene, maker, part))
      fill_flat(scene, plan, tile, part, each, light);
    else
      fill_by_ray(scene, plan, tile, part, each, maker, light);
  }
}

void Background::fill_by_ray(const Scene& scene, const TilePlan& plan, const Tile& tile,
                             ColumnRange columns, float weight, PrimaryPackets::Maker& maker,
                             std::span<float> light) {
  static_assert(TilePlan::kRows == kPacket);
  std::array<int32_t, kPacket> channel;
  std::array<float, kPacket> seen;
  for (int column = columns.begin; column < columns.end; column += kFewPackets) {
    maker.columns(column, packets_);
    for (int k = 0; k < kFewPackets; ++k) {
      const RayPacket& packet = packets_[static_cast<size_t>(k)];
      const uint32_t lanes = lane_bits(packet.valid);
      for (int row = 0; row < TilePlan::kRows; ++row)
        channel[static_cast<size_t>(row)] = channel_at(plan, tile, column + k, row);
      light_beyond_packet(scene.backdrop, packet, lanes, channel, seen);
      for (uint32_t left = lanes; left != 0; left &= left - 1) {
        const auto r = static_cast<size_t>(std::countr_zero(left));
        light[r * static_cast<size_t>(tile.columns) + static_cast<size_t>(column + k)] +=
            weight * seen[r];
      }
    }
  }
}

}  // namespace lenticule::render
