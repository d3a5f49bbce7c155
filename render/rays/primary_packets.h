// SPDX-License-Identifier: Apache-2.0
// The primary rays of a tile, written straight into the packets that Embree takes: one packet is
// sixteen rows of one column, which share lens and view.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "base/cpu.h"
#include "optics/tile_optics.h"
#include "render/rays/beam.h"
#include "render/rays/primary_packets_kernel.h"
#include "render/rays/primary_rays.h"

namespace lenticule::render {

/// Makes rays for one rig; immutable after construction, safe from any thread. Where the rig's map
/// is smooth across a tile the rays come from polynomials (optics/tile_optics.h), otherwise, and
/// for samples off a subpixel's centre, from the map itself, ten times slower.
class PrimaryPackets {
 public:
  /// Both must outlive it.
  PrimaryPackets(const optics::OpticalModel& model, const TilePlan& plan, Isa isa = best_isa());

  /// One tile of one scene, for one thread: start() and then columns in any order.
  class Maker {
   public:
    explicit Maker(const PrimaryPackets& packets);
    Maker(const Maker&) = delete;
    Maker& operator=(const Maker&) = delete;

    /// Directions are not unit: a ray's parameter counts millimetres in front of the glass.
    void start(const Scene& scene, const Tile& tile, const Footprint& footprint);
    /// Packets have to pass here after each start() before they go to columns(), and through
    /// init_packets() once before.
    void prepare(std::span<RayPacket> packets) const;
    /// The same for few rays: instead of columns(), ray() may be asked for. Samples are taken in
    /// the subpixels' centres.
    void start_few(const Scene& scene, const Tile& tile, const Footprint& centre);
    /// Sets a lane to what columns() makes of a subpixel of the tile that is on the panel.
    void ray(int column, int row, RayPacket& out, size_t lane);
    /// Rays of columns [column, column + out.size()) of the tile; `out` is not empty.
    void columns(int column, std::span<RayPacket> out);
    /// Bounds of all rays of these columns. False, and `out` is unspecified, where they are not
    /// known: samples off a subpixel's centre, rays that are not finite.
    [[nodiscard]] bool beam(ColumnRange columns, Beam& out) const;
    /// How many rays these columns have.
    [[nodiscard]] uint64_t count(ColumnRange columns) const;
    /// Lanes of the last start() whose rays were not fit for Embree.
    [[nodiscard]] uint64_t refused() const { return refused_; }

   private:
    /// Of a piece's polynomials, over its rows and colours.
    struct PieceBounds {
      std::array<Interval, 3> bend;
      std::array<Interval, optics::TileOptics::kMostCoefficients> tangent;
      std::array<Interval, optics::TileOptics::kShiftCoefficients> shift_mm;
      Interval x0_mm, y_mm, tan_y;
    };
    /// As wide as the rig's polynomials reach; one that does not touch the panel has no rays.
    struct Piece {
      bool touches_panel = false;
      PieceBounds bounds;
      optics::TileOptics::Tile optics;
      packet_kernel::Tile kernel;
    };
    void begin(const Scene& scene, const Tile& tile, const Footprint& footprint);
    bool set_pieces(const Scene& scene);
    bool combine(const Scene& scene, Piece& piece) const;
    static void set_bounds(const optics::TileOptics& rig, const optics::TileOptics::Tile& in,
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
    bool whole_ = false;  ///< no lane of the tile lies outside the panel
    std::array<int, TilePlan::kRows> first_column_{}, end_column_{};  ///< inside the panel
    uint64_t refused_ = 0;
    std::vector<Piece> pieces_;  ///< side by side
    PrimaryRays::Workspace workspace_;
    std::vector<PathRay> rays_;
    // Of start_few():
    const Scene* scene_ = nullptr;
    const Footprint* centre_ = nullptr;
    std::vector<RayPacket> column_;  ///< one
    optics::RowRays of_pixel_;
  };

  /// False where every tile is made by the map itself.
  [[nodiscard]] bool fast() const { return optics_ != nullptr; }

 private:
  const TilePlan& plan_;
  PrimaryRays exact_;
  std::unique_ptr<optics::TileOptics> optics_;
  const packet_kernel::Kernel& kernel_;
};

/// The line of a lane's ray in the panel frame.
[[nodiscard]] PanelRay panel_ray(const Affine& panel_from_scene, const RayPacket& packet,
                                 size_t lane);

/// Sets what no ray changes: t_near, time, mask, numbers.
void init_packets(std::span<RayPacket> packets);

}  // namespace lenticule::render
