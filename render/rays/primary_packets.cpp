// SPDX-License-Identifier: Apache-2.0
#include "render/rays/primary_packets.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "base/error.h"
#include "render/accel/embree.h"
#include "render/scene/texture.h"

namespace lenticule::render {
namespace {

using packet_kernel::kLanes;

static_assert(TilePlan::kRows == kLanes && TileOptics::kRows == kLanes);

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

/// Candidate widths of pieces with polynomials of their own; the widest that fits the rig's map is
/// used.
constexpr std::array kPieceColumns{TilePlan::kColumns, TilePlan::kColumns / 2,
                                   TilePlan::kColumns / 4};
static_assert(kPieceColumns.back() % 3 == 0);

std::array<int, TilePlan::kRows> shifts_of(const TilePlan& plan) {
  std::array<int, TilePlan::kRows> shifts{};
  for (int row = 0; row < TilePlan::kRows; ++row)
    shifts[static_cast<size_t>(row)] = plan.shift(row);
  return shifts;
}

/// Extends the interval by a value; NaN makes the interval unbounded.
void extend_or_spoil(double value, Interval& interval) {
  if (std::isnan(value)) interval = {-HUGE_VAL, HUGE_VAL};
  interval.extend(value);
}

/// Returns the arrays of a packet as one array of floats, as the kernel writes them.
float* floats_of(RayPacket& packet) { return packet.rays.ray.org_x; }

}  // namespace

PanelRay panel_ray(const Affine& panel_from_scene, const RayPacket& packet, size_t lane) {
  const RTCRay16& rays = packet.rays.ray;
  const Vec3 from = panel_from_scene.point({rays.org_x[lane], rays.org_y[lane], rays.org_z[lane]});
  const Vec3 way = panel_from_scene.vector({rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]});
  const double tan_x = way.x / way.z;
  const double tan_y = way.y / way.z;
  return {.x_mm = from.x - from.z * tan_x,
          .y_mm = from.y - from.z * tan_y,
          .tan_x = tan_x,
          .tan_y = tan_y};
}

void init_packets(std::span<RayPacket> packets) {
  for (RayPacket& packet : packets)
    (void)load_packet({}, packet), std::fill_n(packet.valid, kLanes, -1);
}

PrimaryPackets::PrimaryPackets(const optics::OpticalModel& model, const TilePlan& plan, Isa isa)
    : plan_(plan),
      exact_(model, plan),
      optics_(TileOptics::make_first(model, kPieceColumns, shifts_of(plan))),
      kernel_(LENTICULE_SELECT_KERNEL(isa, kPacketKernel)) {}

PrimaryPackets::Maker::Maker(const PrimaryPackets& packets) : packets_(packets) {
  if (packets.optics_)
    pieces_.resize(static_cast<size_t>(TilePlan::kColumns / packets.optics_->constants().columns));
}

void PrimaryPackets::Maker::start(const Scene& scene, const Tile& tile,
                                  const Footprint& footprint) {
  begin(scene, tile, footprint);
  if (!fast_) packets_.exact_.generate(scene, tile, footprint, 1.0, workspace_, rays_);
}

void PrimaryPackets::Maker::start_few(const Scene& scene, const Tile& tile,
                                      const Footprint& centre) {
  begin(scene, tile, centre);
  scene_ = &scene;
  centre_ = &centre;
  if (column_.empty()) {
    column_.resize(1);
    init_packets(column_);
  }
  prepare(column_);
}

void PrimaryPackets::Maker::ray(int column, int row, RayPacket& out, size_t lane) {
  const auto r = static_cast<size_t>(row);
  LENTICULE_CHECK(column >= first_column_[r] && column < end_column_[r]);
  RayPacket& made = column_.front();
  if (fast_) {
    columns(column, column_);
  } else {
    const int subpixel = packets_.plan_.subpixel(tile_, column, row);
    const PathRay ray =
        packets_.exact_.one(*scene_, tile_.row_begin + row, subpixel, *centre_, of_pixel_);
    set_lane(made, r, Vec3f(ray.origin), Vec3f(ray.direction));
  }
  const RTCRay16& from = made.rays.ray;
  set_lane(out, lane, {from.org_x[r], from.org_y[r], from.org_z[r]},
           {from.dir_x[r], from.dir_y[r], from.dir_z[r]});
  out.rays.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
}

void PrimaryPackets::Maker::begin(const Scene& scene, const Tile& tile,
                                  const Footprint& footprint) {
  LENTICULE_CHECK(tile.columns == TilePlan::kColumns);
  tile_ = tile;
  refused_ = 0;
  centred_ = footprint.centred();
  start_mm_ = packets_.exact_.start_mm(scene);
  origin_size_ = std::abs(start_mm_) + largest_size(scene.scene_from_panel.origin);
  const TilePlan& plan = packets_.plan_;
  whole_ = true;
  for (int row = 0; row < TilePlan::kRows; ++row) {
    const auto r = static_cast<size_t>(row);
    const int of_first = plan.subpixel(tile, 0, row);
    first_column_[r] = std::max(0, -of_first);
    end_column_[r] = row < tile.rows ? std::min(tile.columns, plan.row_subpixels() - of_first) : 0;
    whole_ = whole_ && first_column_[r] == 0 && end_column_[r] == tile.columns;
  }
  fast_ = packets_.optics_ && centred_ && set_pieces(scene);
}

/// Sets up all pieces. Returns false if the polynomials do not cover a piece or a number is not
/// valid for Embree.
bool PrimaryPackets::Maker::set_pieces(const Scene& scene) {
  const int columns = packets_.optics_->constants().columns;
  int begin = 0;
  for (Piece& piece : pieces_) {
    piece.touches_panel = false;
    for (size_t r = 0; r < kLanes; ++r)
      piece.touches_panel |= first_column_[r] < begin + columns && end_column_[r] > begin;
    if (piece.touches_panel &&
        (!packets_.optics_->expand(tile_.row_begin, tile_.column_begin + begin, piece.optics) ||
         !combine(scene, piece)))
      return false;
    begin += columns;
  }
  return true;
}

/// Combines a piece's optics with the start of the rays and the map to the scene.
bool PrimaryPackets::Maker::combine(const Scene& scene, Piece& piece) const {
  packet_kernel::Tile& out = piece.kernel;
  const TileOptics::Constants& rig = packets_.optics_->constants();
  const TileOptics::Tile& in = piece.optics;
  // Rays point away from the viewer, so the direction is -tan per millimetre of depth.
  for (size_t n = 0; n < static_cast<size_t>(rig.coefficients); ++n)
    for (size_t r = 0; r < kLanes; ++r) out.tangent[n][r] = -in.tangent[n][r];
  static_assert(sizeof(out.shift) == sizeof(in.shift_mm));
  std::memcpy(out.shift, in.shift_mm.data(), sizeof(out.shift));
  for (size_t colour = 0; colour < 3; ++colour)
    for (size_t r = 0; r < kLanes; ++r) out.x0[colour][r] = static_cast<float>(in.x0_mm[colour][r]);
  static_assert(sizeof(out.phase) == sizeof(in.phase));
  std::memcpy(out.phase, in.phase.data(), sizeof(out.phase));
  static_assert(sizeof(out.bend) == sizeof(in.bend));
  std::memcpy(out.bend, in.bend.data(), sizeof(out.bend));
  out.coefficients = rig.coefficients;
  out.first_colour = (in.column_begin % 3 + 3) % 3;
  out.lens_step = static_cast<float>(rig.lens_step);
  out.x_step = static_cast<float>(rig.x_step_mm);
  out.safe = static_cast<float>(0.5 - rig.phase_error);
  set_bounds(rig, in, piece.bounds);
  return set_shared(scene, piece);
}

/// Computes the bounds of a piece. Rows outside the panel are included, so the bounds may be wider
/// than necessary.
void PrimaryPackets::Maker::set_bounds(const TileOptics::Constants& rig, const TileOptics::Tile& in,
                                       PieceBounds& out) {
  out = {};
  for (size_t r = 0; r < kLanes; ++r) {
    for (size_t colour = 0; colour < 3; ++colour) {
      for (size_t n = 0; n < 3; ++n) out.bend[n].extend(double{in.bend[colour][n][r]});
      out.x0_mm.extend(in.x0_mm[colour][r]);
    }
    for (size_t n = 0; n < static_cast<size_t>(rig.coefficients); ++n)
      out.tangent[n].extend(double{in.tangent[n][r]});
    for (size_t n = 0; n < out.shift_mm.size(); ++n)
      out.shift_mm[n].extend(double{in.shift_mm[n][r]});
    out.y_mm.extend(in.lens_y_mm[r]);
    out.tan_y.extend(in.tan_y[r]);
  }
}

bool PrimaryPackets::Maker::beam(ColumnRange columns, Beam& out) const {
  if (!centred_) return false;
  out = {};
  out.start_mm = start_mm_;
  if (!fast_) {
    add_exact_to_beam(columns, out);
  } else {
    const int wide = packets_.optics_->constants().columns;
    for (int p = 0; p < static_cast<int>(pieces_.size()); ++p) {
      const ColumnRange in_piece{std::max(columns.begin - p * wide, 0),
                                 std::min(columns.end - p * wide, wide)};
      if (in_piece.begin < in_piece.end)
        add_to_beam(pieces_[static_cast<size_t>(p)], in_piece, out);
    }
  }
  // Directions and positions are rounded to single precision.
  const double room =
      double{kRoundingMargin} * (out.x_mm.largest() + out.y_mm.largest() + origin_size_);
  out.x_mm = out.x_mm.widened(room);
  out.y_mm = out.y_mm.widened(room);
  out.tan_x = out.tan_x.widened(double{kRoundingMargin} * (1.0 + out.tan_x.largest()));
  out.tan_y = out.tan_y.widened(double{kRoundingMargin} * (1.0 + out.tan_y.largest()));
  constexpr double kHarmless = 1e9;
  return std::max({out.x_mm.largest(), out.y_mm.largest(), out.tan_x.largest(), out.tan_y.largest(),
                   std::abs(out.start_mm)}) < kHarmless;
}

namespace {

/// Bounds a polynomial over an argument range around zero.
template <size_t kCount>
Interval values_of(const std::array<Interval, kCount>& coefficients, size_t used,
                   Interval argument) {
  Interval sum = coefficients[0] + coefficients[1] * argument;
  double power = argument.largest();
  for (size_t n = 2; n < used; ++n) {
    power *= argument.largest();
    sum = sum.widened(coefficients[n].largest() * power);
  }
  return sum;
}

}  // namespace

void PrimaryPackets::Maker::add_to_beam(const Piece& piece, ColumnRange columns, Beam& out) const {
  if (!piece.touches_panel) return;
  const TileOptics::Constants& rig = packets_.optics_->constants();
  const PieceBounds& of = piece.bounds;
  constexpr double kMostOff = 0.501;  // largest distance from the nearest lens, in lenses
  constexpr double kRounding = 1e-6;
  const Interval c{double(columns.begin), double(columns.end - 1)};
  const Interval argument = (of.bend[0] + c * (of.bend[1] + c * of.bend[2]))
                                .widened(std::abs(rig.lens_step) * kMostOff + kRounding);
  const Interval shift = values_of(of.shift_mm, of.shift_mm.size(), argument);
  const Interval along{rig.x_step_mm * c.low, rig.x_step_mm * c.high};
  out.x_mm.extend(of.x0_mm + along + shift);
  out.tan_x.extend(values_of(of.tangent, static_cast<size_t>(rig.coefficients), argument));
  out.y_mm.extend(of.y_mm);
  out.tan_y.extend(of.tan_y);
}

void PrimaryPackets::Maker::add_exact_to_beam(ColumnRange columns, Beam& out) const {
  for (size_t r = 0; r < kLanes; ++r) {
    const PrimaryRays::Workspace::Row& row = workspace_.rows[r];
    const int first = packets_.plan_.subpixel(tile_, 0, static_cast<int>(r));
    const int end = std::min(row.end, first + columns.end) - row.first_evaluated;
    for (int k = std::max(row.begin, first + columns.begin) - row.first_evaluated; k < end; ++k) {
      const auto n = static_cast<size_t>(k);
      extend_or_spoil(row.rays.lens_x_mm[n], out.x_mm);
      extend_or_spoil(row.rays.tan_x[n], out.tan_x);
      extend_or_spoil(row.rays.lens_y_mm[n], out.y_mm);
      extend_or_spoil(row.rays.tan_y[n], out.tan_y);
    }
  }
}

uint64_t PrimaryPackets::Maker::count(ColumnRange columns) const {
  uint64_t sum = 0;
  for (size_t r = 0; r < kLanes; ++r)
    sum += static_cast<uint64_t>(std::max(
        0, std::min(columns.end, end_column_[r]) - std::max(columns.begin, first_column_[r])));
  return sum;
}

/// Sets the values that all columns of a row share.
bool PrimaryPackets::Maker::set_shared(const Scene& scene, Piece& piece) const {
  packet_kernel::Tile& out = piece.kernel;
  const double start = start_mm_;
  const Affine& to_scene = scene.scene_from_panel;
  const Vec3f across(to_scene.column_x);
  out.start = static_cast<float>(start);
  out.across[0] = across.x;
  out.across[1] = across.y;
  out.across[2] = across.z;
  bool fit = embree_accepts(across.x, across.y, across.z);
  for (size_t r = 0; r < kLanes; ++r) {
    const double tan_y = piece.optics.tan_y[r];
    const double y = piece.optics.lens_y_mm[r] + start * tan_y;
    const Vec3f origin(to_scene.point({0.0, y, start}));
    const Vec3f direction(to_scene.vector({0.0, -tan_y, -1.0}));
    fit = fit && embree_accepts(origin.x, origin.y, origin.z) &&
          embree_accepts(direction.x, direction.y, direction.z);
    out.origin0[0][r] = origin.x;
    out.origin0[1][r] = origin.y;
    out.origin0[2][r] = origin.z;
    out.direction0[0][r] = direction.x;
    out.direction0[1][r] = direction.y;
    out.direction0[2][r] = direction.z;
  }
  return fit;
}

void PrimaryPackets::Maker::prepare(std::span<RayPacket> packets) const {
  if (!whole_) return;
  for (RayPacket& packet : packets) std::fill_n(packet.valid, kLanes, -1);
}

void PrimaryPackets::Maker::columns(int column, std::span<RayPacket> out) {
  const auto count = static_cast<int>(out.size());
  if (!fast_) {
    for (int k = 0; k < count; ++k) copy_exact(column + k, out[static_cast<size_t>(k)]);
    return;
  }
  const int wide = packets_.optics_->constants().columns;
  for (int done = 0; done < count;) {
    const int in_piece = (column + done) % wide;
    const int next = std::min(count - done, wide - in_piece);
    make_columns(pieces_[static_cast<size_t>((column + done) / wide)], in_piece,
                 out.subspan(static_cast<size_t>(done), static_cast<size_t>(next)));
    done += next;
  }
  if (whole_) return;
  for (int k = 0; k < count; ++k) set_valid(column + k, out[static_cast<size_t>(k)]);
}

/// Makes columns of a piece; `column` counts from the beginning of the piece.
void PrimaryPackets::Maker::make_columns(const Piece& piece, int column,
                                         std::span<RayPacket> out) const {
  if (!piece.touches_panel) return;
  const int count = static_cast<int>(out.size());
  const packet_kernel::Kernel& kernel = packets_.kernel_;
  if (kernel.make(piece.kernel, column, count, floats_of(out.front()), kStride)) [[unlikely]]
    for (int k = 0; k < count; ++k)
      if (kernel.uncertain(piece.kernel, column + k))
        resolve(piece, column + k, out[static_cast<size_t>(k)]);
}

void PrimaryPackets::Maker::resolve(const Piece& piece, int column, RayPacket& out) const {
  alignas(64) std::array<float, kLanes> off;
  for (int row = 0; row < kLanes; ++row)
    off[static_cast<size_t>(row)] =
        static_cast<float>(packets_.optics_->exact_off(piece.optics, column, row));
  packets_.kernel_.make_one(piece.kernel, column, off.data(), floats_of(out));
}

void PrimaryPackets::Maker::set_valid(int column, RayPacket& out) const {
  for (size_t r = 0; r < kLanes; ++r)
    out.valid[r] = column >= first_column_[r] && column < end_column_[r] ? -1 : 0;
}

void PrimaryPackets::Maker::copy_exact(int column, RayPacket& out) {
  refused_ +=
      load_packet(std::span(rays_).subspan(static_cast<size_t>(column) * kLanes, kLanes), out);
}

void light_beyond_packet(const Backdrop& backdrop, const RayPacket& packet, uint32_t lanes,
                         std::span<const int32_t, kPacket> channel,
                         std::array<float, kPacket>& out) {
  static_assert(GroundShadow::kRays == kPacket);
  const RTCRay16& ray = packet.rays.ray;
  if (backdrop.ground_shadow) {
    std::array<double, kPacket> left;
    backdrop.ground_shadow->light_left({.origin_x = ray.org_x,
                                        .origin_y = ray.org_y,
                                        .origin_z = ray.org_z,
                                        .direction_x = ray.dir_x,
                                        .direction_y = ray.dir_y,
                                        .direction_z = ray.dir_z},
                                       left);
    for (size_t r = 0; r < kPacket; ++r)
      out[r] = static_cast<float>(component(backdrop.colour, channel[r]) * left[r]);
    return;
  }
  for (; lanes != 0; lanes &= lanes - 1) {
    const auto r = static_cast<size_t>(std::countr_zero(lanes));
    const Vec3 direction{double{ray.dir_x[r]}, double{ray.dir_y[r]}, double{ray.dir_z[r]}};
    out[r] = static_cast<float>(backdrop_light(backdrop, normalized(direction), channel[r]));
  }
}

}  // namespace lenticule::render
