// SPDX-License-Identifier: Apache-2.0
#include "render/primary_packets.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "optics/error.h"

namespace lenticule::render {
namespace {

using packet_kernel::kLanes;

static_assert(TilePlan::kRows == kLanes && optics::TileOptics::kRows == kLanes);

constexpr bool lies_at(size_t offset, packet_kernel::Field field) {
  return offset == sizeof(float) * kLanes * static_cast<size_t>(field);
}
static_assert(lies_at(offsetof(RTCRayHit16, ray.org_x), packet_kernel::kOriginX) &&
              lies_at(offsetof(RTCRayHit16, ray.dir_x), packet_kernel::kDirectionX) &&
              lies_at(offsetof(RTCRayHit16, ray.tfar), packet_kernel::kTFar) &&
              lies_at(offsetof(RTCRayHit16, ray.flags), packet_kernel::kFlags) &&
              lies_at(offsetof(RTCRayHit16, hit.Ng_x), packet_kernel::kNormalX) &&
              lies_at(offsetof(RTCRayHit16, hit.u), packet_kernel::kU) &&
              lies_at(offsetof(RTCRayHit16, hit.primID), packet_kernel::kPrimitive) &&
              lies_at(offsetof(RTCRayHit16, hit.geomID), packet_kernel::kGeometry));
constexpr int kStride = sizeof(RayPacket) / sizeof(float);

const packet_kernel::Kernel& kernel_for(Isa isa) {
#if defined(__x86_64__)
  if (isa == Isa::Avx512) return isa_avx512::kPacketKernel;
  if (isa == Isa::Avx2) return isa_avx2::kPacketKernel;
#endif
  static_cast<void>(isa);
  return isa_baseline::kPacketKernel;
}

std::array<int, TilePlan::kRows> shifts_of(const TilePlan& plan) {
  std::array<int, TilePlan::kRows> shifts{};
  for (int row = 0; row < TilePlan::kRows; ++row)
    shifts[static_cast<size_t>(row)] = plan.shift(row);
  return shifts;
}

/// What the kernel writes is in the arrays of a packet, one after the other.
float* floats_of(RayPacket& packet) {
  return packet.rays.ray.org_x;
}

}  // namespace

void init_packets(std::span<RayPacket> packets) {
  for (RayPacket& packet : packets)
    (void)load_packet({}, packet), std::fill_n(packet.valid, kLanes, -1);
}

PrimaryPackets::PrimaryPackets(const optics::OpticalModel& model, const TilePlan& plan, Isa isa)
    : plan_(plan),
      exact_(model, plan),
      optics_(optics::TileOptics::make(model, TilePlan::kColumns, shifts_of(plan))),
      kernel_(kernel_for(isa)) {}

PrimaryPackets::Maker::Maker(const PrimaryPackets& packets) : packets_(packets) {}

void PrimaryPackets::Maker::start(const Scene::Impl& scene, const Tile& tile,
                                  const Footprint& footprint) {
  tile_ = tile;
  refused_ = 0;
  const TilePlan& plan = packets_.plan_;
  const auto [least, most] = std::minmax({0, plan.shift(TilePlan::kRows - 1)});
  whole_ = tile.rows == TilePlan::kRows && tile.column_begin - most >= 0 &&
           tile.column_begin + tile.columns - least <= plan.row_subpixels();
  fast_ = packets_.optics_ && footprint.centred() &&
          packets_.optics_->expand(tile.row_begin, tile.column_begin, optics_);
  if (fast_) set_fast_tile(scene);
  if (!fast_) packets_.exact_.generate(scene, tile, footprint, 1.0, workspace_, rays_);
}

/// Combines the tile's optics with where rays start and the map to the scene; gives up the fast way
/// where a number is not fit for Embree.
void PrimaryPackets::Maker::set_fast_tile(const Scene::Impl& scene) {
  const optics::TileOptics::Constants& c = packets_.optics_->constants();
  const double start = packets_.exact_.start_mm(scene);
  const Affine& to_scene = scene.scene_from_panel;
  const auto used = static_cast<size_t>(c.coefficients);
  for (size_t n = 0; n < used; ++n)
    for (size_t r = 0; r < kLanes; ++r)
      along_[n][r] = static_cast<float>(optics_.shift_mm[n][r] + start * optics_.tangent[n][r]);
  for (size_t r = 0; r < kLanes; ++r) {
    const double y = optics_.lens_y_mm[r] + start * optics_.tan_y[r];
    const Vec3f origin(to_scene.point({optics_.x0_mm[r], y, start}));
    const Vec3f direction(to_scene.vector({0.0, -optics_.tan_y[r], -1.0}));
    if (!embree_accepts(origin.x, origin.y, origin.z) ||
        !embree_accepts(direction.x, direction.y, direction.z))
      fast_ = false;
    origin0_[0][r] = origin.x;
    origin0_[1][r] = origin.y;
    origin0_[2][r] = origin.z;
    direction0_[0][r] = direction.x;
    direction0_[1][r] = direction.y;
    direction0_[2][r] = direction.z;
  }
  const Vec3f across(to_scene.column_x);
  fast_ = fast_ && embree_accepts(across.x, across.y, across.z);
  kernel_ = {
      .phase0 = optics_.phase0.data(),
      .phase1 = optics_.phase1.data(),
      .phase2 = optics_.phase2.data(),
      .argument0 = optics_.argument0.data(),
      .column_nudge = {c.column_nudge[0].data(), c.column_nudge[1].data(),
                       c.column_nudge[2].data()},
      .phase_nudge = {c.phase_nudge[0].data(), c.phase_nudge[1].data(), c.phase_nudge[2].data()},
      .argument_nudge = {c.argument_nudge[0].data(), c.argument_nudge[1].data(),
                         c.argument_nudge[2].data()},
      .x_nudge = {c.x_nudge_mm[0].data(), c.x_nudge_mm[1].data(), c.x_nudge_mm[2].data()},
      .tangent = optics_.tangent[0].data(),
      .along = along_[0].data(),
      .lens_step = c.lens_step,
      .argument_step = c.argument_step,
      .border_tolerance = optics::kBorderTolerance,
      .safe = 0.5 - c.phase_error,
      .x_step = static_cast<float>(c.x_step_mm),
      .coefficients = c.coefficients,
      .first_colour = (tile_.column_begin % 3 + 3) % 3,
      .origin0_x = origin0_[0].data(),
      .origin0_y = origin0_[1].data(),
      .origin0_z = origin0_[2].data(),
      .direction0_x = direction0_[0].data(),
      .direction0_y = direction0_[1].data(),
      .direction0_z = direction0_[2].data(),
      .across_x = across.x,
      .across_y = across.y,
      .across_z = across.z};
}

void PrimaryPackets::Maker::columns(int column, std::span<RayPacket> out) {
  constexpr size_t kBatch = 8;
  for (size_t at = 0; at < out.size(); at += kBatch) {
    const int first = column + static_cast<int>(at);
    const auto batch = out.subspan(at, std::min(kBatch, out.size() - at));
    if (!fast_) {
      for (size_t k = 0; k < batch.size(); ++k) copy_exact(first + static_cast<int>(k), batch[k]);
      continue;
    }
    std::array<uint32_t, kBatch> uncertain;
    packets_.kernel_.make(kernel_, first, static_cast<int>(batch.size()), floats_of(batch.front()),
                          kStride, uncertain.data());
    for (size_t k = 0; k < batch.size(); ++k) {
      const int at_column = first + static_cast<int>(k);
      if (uncertain[k] != 0) [[unlikely]]
        resolve(at_column, batch[k]);
      if (!whole_) set_valid(at_column, batch[k]);
    }
  }
}

void PrimaryPackets::Maker::resolve(int column, RayPacket& out) const {
  alignas(64) std::array<double, kLanes> lenses;
  for (int row = 0; row < kLanes; ++row)
    lenses[static_cast<size_t>(row)] = packets_.optics_->exact_lens(optics_, column, row);
  packets_.kernel_.make_one(kernel_, column, lenses.data(), floats_of(out));
}

void PrimaryPackets::Maker::set_valid(int column, RayPacket& out) const {
  const TilePlan& plan = packets_.plan_;
  for (int row = 0; row < kLanes; ++row) {
    const int s = plan.subpixel(tile_, column, row);
    const bool inside = row < tile_.rows && s >= 0 && s < plan.row_subpixels();
    out.valid[row] = inside ? -1 : 0;
  }
}

void PrimaryPackets::Maker::copy_exact(int column, RayPacket& out) {
  refused_ +=
      load_packet(std::span(rays_).subspan(static_cast<size_t>(column) * kLanes, kLanes), out);
}

}  // namespace lenticule::render
