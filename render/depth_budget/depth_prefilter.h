// SPDX-License-Identifier: Apache-2.0
// Method full with Prefilter::Depth or Beam: what the primary rays of a tile met, beyond the depth
// of field or anywhere, is averaged over the beams of its subpixels.
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

struct PrefilterCounts {
  uint64_t averaged = 0;       ///< subpixels
  uint64_t rays = 0;           ///< for them, beside those through their middles
  uint64_t rays_left_out = 0;  ///< that depth asked for, where neighbours agreed
  PrefilterCounts& operator+=(const PrefilterCounts& other);
};

/// Of one rig; immutable, safe from any thread. What it does to a tile depends on that tile alone.
class DepthPrefilter {
 public:
  /// The model and the plan must outlive it.
  DepthPrefilter(const optics::OpticalModel& model, const TilePlan& plan,
                 const RenderOptions& options);

  /// Of one thread and one scene; keeps its memory from tile to tile. Calling threads must flush
  /// denormals.
  class Worker {
   public:
    /// Both must outlive it.
    Worker(const DepthPrefilter& prefilter, const Scene& scene);

    /// Begins a tile. Every packet of primary rays has to pass through the notes.
    DepthNotes& start(const Tile& tile);
    /// `light` has one ray of each subpixel, by row * columns + column, of the tile that `maker`
    /// was started with; subpixels that saw something beyond the depth of field, or all, get the
    /// mean over their beams. Where the neighbours of the same colour, a lens to both sides and a
    /// row above and below, have the same code but for kAgreement, that is the mean, and no ray is
    /// traced.
    void average(const Tile& tile, PrimaryPackets::Maker& maker, std::span<float> light);

    [[nodiscard]] const PrefilterCounts& counts() const { return counts_; }
    [[nodiscard]] RayCounts rays() const { return tracer_.counts(); }

   private:
    struct Listed {
      uint32_t target = 0;
      int32_t subpixel = 0;  ///< of its row
      int32_t row = 0;       ///< of the tile
      int rays = 0;
      const std::vector<Footprint>* places = nullptr;  ///< of the rays
      PanelRay middle;
      float sum = 0.0F;  ///< of the rays beside the middle
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
    std::vector<RayPacket> packet_;  ///< one
    alignas(64) std::array<int32_t, kPacket> channel_{};
    std::array<uint32_t, kPacket> seeds_{};
    alignas(64) std::array<float, kPacket> light_{};
    PrefilterCounts counts_;
  };

  /// Code values by which neighbours may differ for the middle ray to stand for all.
  static constexpr int kAgreement = 2;

 private:
  /// 1 for what is not averaged.
  [[nodiscard]] int rays_for(double z_mm, const PanelRay& middle) const;
  /// Whether nothing at that depth is averaged, whatever its ray.
  [[nodiscard]] bool surely_left(double z_mm) const {
    return !everything_ && std::abs(z_mm) <= least_depth_of_field_mm_;
  }

  const TilePlan& plan_;
  DepthOfField depth_of_field_;
  double least_depth_of_field_mm_;
  RenderOptions options_;
  bool everything_;
  double distance_mm_;
  int reach_;  ///< same-coloured subpixels to either side that make up a lens
  std::map<int, std::vector<Footprint>> beams_;  ///< by number of rays
};

}  // namespace lenticule::render
