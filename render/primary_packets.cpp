// SPDX-License-Identifier: Apache-2.0
#include "render/primary_packets.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

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
  whole_ = true;
  for (int row = 0; row < TilePlan::kRows; ++row) {
    const auto r = static_cast<size_t>(row);
    const int of_first = plan.subpixel(tile, 0, row);
    first_column_[r] = std::max(0, -of_first);
    end_column_[r] = row < tile.rows ? std::min(tile.columns, plan.row_subpixels() - of_first) : 0;
    whole_ = whole_ && first_column_[r] == 0 && end_column_[r] == tile.columns;
  }
  fast_ = packets_.optics_ && footprint.centred() &&
          packets_.optics_->expand(tile.row_begin, tile.column_begin, optics_);
  if (fast_) set_fast_tile(scene);
  if (!fast_) packets_.exact_.generate(scene, tile, footprint, 1.0, workspace_, rays_);
}

/// Combines the tile's optics with where rays start and the map to the scene; gives up the fast way
/// where a number is not fit for Embree.
void PrimaryPackets::Maker::set_fast_tile(const Scene::Impl& scene) {
  const double start = packets_.exact_.start_mm(scene);
  const Affine& to_scene = scene.scene_from_panel;
  const Vec3f across(to_scene.column_x);
  kernel_.parallel = across.x == 1.0F && across.y == 0.0F && across.z == 0.0F &&
                     to_scene.column_y.x == 0.0 && to_scene.column_z.x == 0.0 &&
                     to_scene.origin.x == 0.0;
  kernel_.across[0] = across.x;
  kernel_.across[1] = across.y;
  kernel_.across[2] = across.z;
  // A ray goes away from the viewer: -tan for each millimetre of depth.
  const auto used = static_cast<size_t>(packets_.optics_->coefficients());
  for (size_t n = 0; n < used; ++n)
    for (size_t r = 0; r < kLanes; ++r) kernel_.tangent[n][r] = -optics_.tangent[n][r];
  static_assert(sizeof(kernel_.shift) == sizeof(optics_.shift_mm));
  std::memcpy(kernel_.shift, optics_.shift_mm.data(), sizeof(kernel_.shift));
  kernel_.start = static_cast<float>(start);
  bool fit = embree_accepts(across.x, across.y, across.z);
  for (size_t r = 0; r < kLanes; ++r) {
    const double y = optics_.lens_y_mm[r] + start * optics_.tan_y[r];
    const Vec3f origin(to_scene.point({0.0, y, start}));
    const Vec3f direction(to_scene.vector({0.0, -optics_.tan_y[r], -1.0}));
    fit = fit && embree_accepts(origin.x, origin.y, origin.z) &&
          embree_accepts(direction.x, direction.y, direction.z);
    kernel_.origin0[0][r] = origin.x;
    kernel_.origin0[1][r] = origin.y;
    kernel_.origin0[2][r] = origin.z;
    kernel_.direction0[0][r] = direction.x;
    kernel_.direction0[1][r] = direction.y;
    kernel_.direction0[2][r] = direction.z;
  }
  for (size_t colour = 0; colour < 3; ++colour)
    for (size_t r = 0; r < kLanes; ++r)
      kernel_.x0[colour][r] = static_cast<float>(optics_.x0_mm[colour][r]);
  static_assert(sizeof(kernel_.phase) == sizeof(optics_.phase));
  std::memcpy(kernel_.phase, optics_.phase.data(), sizeof(kernel_.phase));
  static_assert(sizeof(kernel_.bend) == sizeof(optics_.bend));
  std::memcpy(kernel_.bend, optics_.bend.data(), sizeof(kernel_.bend));
  kernel_.coefficients = packets_.optics_->coefficients();
  kernel_.first_colour = (tile_.column_begin % 3 + 3) % 3;
  kernel_.lens_step = static_cast<float>(packets_.optics_->lens_step());
  kernel_.x_step = static_cast<float>(packets_.optics_->x_step_mm());
  kernel_.safe = static_cast<float>(0.5 - packets_.optics_->phase_error());
  fast_ = fit;
}

void PrimaryPackets::Maker::prepare(std::span<RayPacket> packets) const {
  for (RayPacket& packet : packets) {
    if (whole_) std::fill_n(packet.valid, kLanes, -1);
    if (!fast_ || !kernel_.parallel) continue;
    RTCRay16& ray = packet.rays.ray;
    std::copy_n(kernel_.origin0[1], kLanes, ray.org_y);
    std::copy_n(kernel_.origin0[2], kLanes, ray.org_z);
    std::copy_n(kernel_.direction0[1], kLanes, ray.dir_y);
    std::copy_n(kernel_.direction0[2], kLanes, ray.dir_z);
  }
}

void PrimaryPackets::Maker::columns(int column, std::span<RayPacket> out) {
  const int count = static_cast<int>(out.size());
  if (!fast_) {
    for (int k = 0; k < count; ++k) copy_exact(column + k, out[static_cast<size_t>(k)]);
    return;
  }
  if (packets_.kernel_.make(kernel_, column, count, floats_of(out.front()), kStride)) [[unlikely]]
    for (int k = 0; k < count; ++k)
      if (packets_.kernel_.uncertain(kernel_, column + k))
        resolve(column + k, out[static_cast<size_t>(k)]);
  if (whole_) return;
  for (int k = 0; k < count; ++k) set_valid(column + k, out[static_cast<size_t>(k)]);
}

void PrimaryPackets::Maker::resolve(int column, RayPacket& out) const {
  alignas(64) std::array<float, kLanes> off;
  for (int row = 0; row < kLanes; ++row)
    off[static_cast<size_t>(row)] =
        static_cast<float>(packets_.optics_->exact_off(optics_, column, row));
  packets_.kernel_.make_one(kernel_, column, off.data(), floats_of(out));
}

void PrimaryPackets::Maker::set_valid(int column, RayPacket& out) const {
  for (size_t r = 0; r < kLanes; ++r)
    out.valid[r] = column >= first_column_[r] && column < end_column_[r] ? -1 : 0;
}

void PrimaryPackets::Maker::copy_exact(int column, RayPacket& out) {
  refused_ +=
      load_packet(std::span(rays_).subspan(static_cast<size_t>(column) * kLanes, kLanes), out);
}

}  // namespace lenticule::render
