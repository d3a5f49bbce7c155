// SPDX-License-Identifier: Apache-2.0
// DepthPrefilter implements Prefilter::Depth and Prefilter::Beam of method full: subpixels whose
// primary rays hit content beyond the depth of field, or any content, are averaged over their
// footprint.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "render/depth_budget/depth_of_field.h"
#include "render/integrator/depth_notes.h"
#include "render/integrator/packet_tracer.h"
#include "render/rays/footprint.h"
#include "render/rays/primary_packets.h"
#include "render/rays/tile.h"
#include "render/shading/light_encoder.h"

namespace lenticule::render {

/// DepthPrefilter serves one rig. The result for a tile depends on that tile only. Thread safety:
/// immutable, usable from any thread.
class DepthPrefilter {
 public:
  /// Lifetime: `model` and `plan` must outlive the object.
  DepthPrefilter(const optics::OpticalModel& model, const TilePlan& plan,
                 const RenderOptions& options);

  /// Worker filters tiles of one scene. The calling thread must flush denormals. Thread safety:
  /// used by one thread. It keeps its memory from tile to tile.
  class Worker {
   public:
    /// Lifetime: `prefilter` and `scene` must outlive the object.
    Worker(const DepthPrefilter& prefilter, const Scene& scene);

    /// Begins a tile. The caller must pass every packet of primary rays to the returned notes.
    DepthNotes& start(const Tile& tile);
    /// Averages the subpixels of the tile that `maker` was started with. `light` has one ray per
    /// subpixel, by row * columns + column. Subpixels that see content beyond the depth of field
    /// (or all subpixels) get the mean over their footprint. If the neighbours of the same colour
    /// (a lens width to both sides, and the rows above and below) have the same code to within
    /// kAgreement, the centre ray stands for the mean and no ray is traced.
    void average(const Tile& tile, PrimaryPackets::Maker& maker, std::span<float> light);

    /// Returns the counters of averaged subpixels and of their rays.
    [[nodiscard]] FrameCounts counts() const;

   private:
    struct Listed {
      uint32_t target = 0;
      int32_t subpixel = 0;  ///< index in its row
      int32_t row = 0;       ///< index in the tile
      int rays = 0;
      const std::vector<Footprint>* places = nullptr;  ///< places of the rays
      PanelRay middle;
      float sum = 0.0F;  ///< sum over all rays except the centre ray
    };
    [[nodiscard]] bool encode(std::span<const float> light);
    void list_column(const Tile& tile, int column, PrimaryPackets::Maker& maker);
    [[nodiscard]] bool neighbours_agree(const Tile& tile, int column, int row) const;
    void trace_listed(const Tile& tile);
    void load(const Tile& tile, std::span<const Listed> subpixels, int number);

    const DepthPrefilter& prefilter_;
    const Scene& scene_;
    Affine panel_from_scene_;
    double start_mm_;
    DepthNotes notes_;
    LightEncoder encoder_;
    PacketTracer tracer_;
    std::vector<uint8_t> codes_;
    std::vector<Listed> listed_;
    std::vector<RayPacket> packet_;  ///< a single packet
    alignas(64) std::array<int32_t, kPacket> channel_{};
    std::array<uint32_t, kPacket> seeds_{};
    alignas(64) std::array<float, kPacket> light_{};
    FrameCounts counts_;
  };

  /// Largest difference in code values between neighbours at which the centre ray stands for the
  /// mean.
  static constexpr int kAgreement = 2;

 private:
  /// Returns the number of rays; 1 if the subpixel is not averaged.
  [[nodiscard]] int rays_for(double z_mm, const PanelRay& middle) const;
  /// Returns true if no subpixel at that depth is averaged, regardless of its ray.
  [[nodiscard]] bool surely_left(double z_mm) const {
    return !everything_ && std::abs(z_mm) <= least_depth_of_field_mm_;
  }

  const TilePlan& plan_;
  DepthOfField depth_of_field_;
  double least_depth_of_field_mm_;
  RenderOptions options_;
  bool everything_;
  double distance_mm_;
  int reach_;  ///< number of subpixels of one colour to each side that make up a lens
  std::map<int, std::vector<Footprint>> beams_;  ///< keyed by number of rays
};

}  // namespace lenticule::render
