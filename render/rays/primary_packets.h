// SPDX-License-Identifier: Apache-2.0
// Primary rays of a tile, written directly into the packets that Embree takes. One packet is
// sixteen rows of one column, which share lens and view.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/cpu.h"
#include "render/accel/ray_stream.h"
#include "render/rays/primary_packets_kernel.h"
#include "render/rays/primary_rays.h"
#include "render/rays/tile_optics.h"
#include "render/scene/surroundings.h"

namespace lenticule::render {

/// PrimaryPackets makes primary rays for one rig. If the rig's map is smooth across a tile, the
/// rays come from polynomials (render/rays/tile_optics.h); otherwise, and for samples off a
/// subpixel's centre, from the map itself, which is ten times slower. Thread safety: immutable
/// after construction, usable from any thread.
class PrimaryPackets {
 public:
  /// Lifetime: `model` and `plan` must outlive the object.
  PrimaryPackets(const optics::OpticalModel& model, const TilePlan& plan, Isa isa = best_isa());

  /// Maker makes the rays of one tile of one scene: call start(), then columns() in any order.
  /// Thread safety: used by one thread.
  class Maker {
   public:
    explicit Maker(const PrimaryPackets& packets);
    Maker(const Maker&) = delete;
    Maker& operator=(const Maker&) = delete;

    /// Begins a tile. Ray directions are not unit: the ray parameter counts millimetres in front of
    /// the panel.
    void start(const Scene& scene, const Tile& tile, const Footprint& footprint);
    /// Prepares packets for columns(). Required after each start(); init_packets() is required once
    /// before.
    void prepare(std::span<RayPacket> packets) const;
    /// Begins a tile of which few rays are needed: afterwards use ray() instead of columns().
    /// Samples lie at the subpixels' centres.
    void start_few(const Scene& scene, const Tile& tile, const Footprint& centre);
    /// Sets a lane to the ray that columns() makes for a subpixel of the tile; the subpixel must be
    /// on the panel.
    void ray(int column, int row, RayPacket& out, size_t lane);
    /// Makes the rays of columns [column, column + out.size()) of the tile; `out` must not be
    /// empty.
    void columns(int column, std::span<RayPacket> out);
    /// Computes bounds of all rays of these columns. Returns false, and leaves `out` unspecified,
    /// if bounds are unknown: for samples off a subpixel's centre and for non-finite rays.
    [[nodiscard]] bool beam(ColumnRange columns, Beam& out) const;
    /// Returns the number of rays of these columns.
    [[nodiscard]] uint64_t count(ColumnRange columns) const;
    /// Returns the number of lanes since the last start() whose rays were not valid for Embree.
    [[nodiscard]] uint64_t refused() const { return refused_; }

   private:
    /// Bounds of a piece's polynomials, over its rows and colours.
    struct PieceBounds {
      std::array<Interval, 3> bend;
      std::array<Interval, TileOptics::kMostCoefficients> tangent;
      std::array<Interval, TileOptics::kShiftCoefficients> shift_mm;
      Interval x0_mm, y_mm, tan_y;
    };
    /// Piece is a part of a tile as wide as the range of the rig's polynomials. A piece that does
    /// not touch the panel has no rays.
    struct Piece {
      bool touches_panel = false;
      PieceBounds bounds;
      TileOptics::Tile optics;
      packet_kernel::Tile kernel;
    };
    void begin(const Scene& scene, const Tile& tile, const Footprint& footprint);
    bool set_pieces(const Scene& scene);
    bool combine(const Scene& scene, Piece& piece) const;
    static void set_bounds(const TileOptics::Constants& rig, const TileOptics::Tile& in,
                           PieceBounds& out);
    void add_to_beam(const Piece& piece, ColumnRange columns, Beam& out) const;
    void add_exact_to_beam(ColumnRange columns, Beam& out) const;
    bool set_shared(const Scene& scene, Piece& piece) const;
    void make_columns(const Piece& piece, int column, std::span<RayPacket> out) const;
    void resolve(const Piece& piece, int column, RayPacket& out) const;
    void set_valid(int column, RayPacket& out) const;
    void copy_exact(int column, RayPacket& out);

    const PrimaryPackets& packets_;
    Tile tile_;
    bool fast_ = false;
    bool centred_ = false;
    double start_mm_ = 0.0;
    double origin_size_ = 0.0;  ///< bound of what x and y are added to
    bool whole_ = false;        ///< no lane of the tile lies outside the panel
    std::array<int, TilePlan::kRows> first_column_{}, end_column_{};  ///< columns inside the panel
    uint64_t refused_ = 0;
    std::vector<Piece> pieces_;  ///< ordered from left to right
    PrimaryRays::Workspace workspace_;
    std::vector<PathRay> rays_;
    // Set by start_few() for ray():
    const Scene* scene_ = nullptr;
    const Footprint* centre_ = nullptr;
    std::vector<RayPacket> column_;  ///< a single packet
    optics::RowRays of_pixel_;
  };

  /// Returns false if every tile is computed by the map itself.
  [[nodiscard]] bool fast() const { return optics_ != nullptr; }

 private:
  const TilePlan& plan_;
  PrimaryRays exact_;
  std::unique_ptr<TileOptics> optics_;
  const packet_kernel::Kernel& kernel_;
};

/// Returns the line of a lane's ray in the panel frame.
[[nodiscard]] PanelRay panel_ray(const Affine& panel_from_scene, const RayPacket& packet,
                                 size_t lane);

/// Sets the fields that are the same for all rays: t_near, time, mask, numbers.
void init_packets(std::span<RayPacket> packets);

/// Computes light_beyond() of the rays in `lanes` (bit r for lane r), each in its channel; other
/// elements of the result are unspecified. A ray's result does not depend on the other lanes.
void light_beyond_packet(const Backdrop& backdrop, const RayPacket& packet, uint32_t lanes,
                         std::span<const int32_t, kPacket> channel,
                         std::array<float, kPacket>& out);

}  // namespace lenticule::render
