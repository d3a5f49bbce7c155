// SPDX-License-Identifier: Apache-2.0
// Averages over the beam that a lens shows of one subpixel, and the number of rays for them.
//
// A lens shows an eye one colour across its whole width, and shows that colour to every eye within
// the angle d that the subpixel subtends. The correct colour of a subpixel is the mean over its
// beam: all rays between these places on the lens and these eyes, over the height of the pixel. At
// depth z the lens makes the beam p_h |1 - z / Z| wide and the subpixel makes it |z| d wide; the
// two box filters are convolved. The height of a pixel of size a under a lens of slant m adds a
// third box of width m a |1 + z d / s|, where s is the width of a subpixel on the panel: lower
// parts of a pixel lie elsewhere under its lens. Within the depth of field the lens's box is the
// widest of the three; beyond it the subpixel's box or, at slants of more than a third, the
// height's.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "frames/frame.h"
#include "optics/model.h"
#include "render/integrator/packet_tracer.h"
#include "render/options/render_options.h"
#include "render/rays/primary_packets.h"
#include "render/rays/primary_rays.h"
#include "render/scene/scene.h"
#include "render/shading/light_encoder.h"

namespace lenticule::render {

/// DepthOfField describes one rig. From one subpixel of a lens to the next, the tangent of the rays
/// changes by d. A point at depth z moves by |z| d on the panel, and is no longer sharp if this is
/// more than a lens pitch p_h. Refraction spreads oblique rays: with kappa = 1 - nu,
///
/// depth of field = p_h / d = g P (1 + kappa t_y^2) / (1 + kappa (t_x^2 + t_y^2))^(3/2),
///
/// where d is the derivative of t_x by the panel point (docs/panel/optics.md, "Depth of field").
/// Residual maps are ignored: they change the pitch, and so the depth of field, by at most ten
/// percent.
class DepthOfField {
 public:
  explicit DepthOfField(const optics::OpticalModel& model);

  /// Returns the depth of field along a ray in direction (tan_x, tan_y, 1), millimetres in front of
  /// and behind the panel. Tangents above 1 count as 1.
  [[nodiscard]] double along_mm(double tan_x, double tan_y) const;
  /// Returns a lower bound for all rays.
  [[nodiscard]] double least_mm() const;

 private:
  double straight_mm_;  ///< g P: that of rays perpendicular to the panel
  double kappa_;
};

/// Parses "off", "depth", "beam" or "exhaustive"; throws Error(Usage) for any other name.
[[nodiscard]] Prefilter prefilter_named(const std::string& name);

/// Returns places inside a subpixel's beam that represent it with equal weights. They are spread
/// evenly, foremost over the subpixel's width, and also over its height and across the lens. The
/// first place is the centre; the others come in pairs symmetric about it. `count` should be odd;
/// an even count is reduced by one.
[[nodiscard]] std::vector<SubpixelPlace> beam_samples(int count);

/// Returns the number of rays over the beam for content at `depth` depths of field from the panel:
/// two per lens pitch of the beam's width, rounded up to 2^k + 1, but at most `most`.
[[nodiscard]] int beam_rays(double depth, int most);

// DepthPrefilter implements Prefilter::Depth and Prefilter::Beam of method full: subpixels whose
// primary rays hit content beyond the depth of field, or any content, are averaged over their
// footprint.

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
    DepthRecorder& start(const Tile& tile);
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
    DepthRecorder notes_;
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

// DepthHistogram measures the depths that a frame's subpixels see, in units of the sheet's depth of
// field.

/// DepthHistogram counts subpixels by depth z, divided by the depth of field along the subpixel's
/// own ray; positive in front of the panel.
struct DepthHistogram {
  static constexpr int kBinsPerDepth = 8;
  static constexpr int kReach = 16;  ///< depths of field to each side

  /// Number N of subpixels per lens: within 1/N depths of field all views of a lens see the same
  /// content to within a lens pitch.
  double views = 1.0;
  uint64_t nothing = 0;
  uint64_t at_panel = 0;  ///< part of `within`
  uint64_t within = 0;    ///< up to one depth of field away
  uint64_t in_front = 0;  ///< more than one depth of field
  uint64_t behind = 0;    ///< more than one depth of field
  /// Panel z of the extreme visible points; -infinity and infinity if there are none.
  double nearest_mm = -std::numeric_limits<double>::infinity();
  double farthest_mm = std::numeric_limits<double>::infinity();
  /// Bins from -kReach to kReach; depths beyond are counted in the first and the last bin.
  std::vector<uint64_t> bins = std::vector<uint64_t>(size_t{2} * kReach * kBinsPerDepth);

  /// Adds one subpixel; `depth` is infinite if the subpixel sees nothing.
  void add(double depth, double subpixel_z_mm);
  DepthHistogram& operator+=(const DepthHistogram& other);

  [[nodiscard]] uint64_t subpixels() const { return nothing + within + in_front + behind; }
  /// Returns the lower end of a bin, in depths of field.
  [[nodiscard]] static double bin_begin(size_t bin) {
    return static_cast<double>(bin) / kBinsPerDepth - kReach;
  }
};

/// Optional pictures of a frame's depths; both have the panel's size.
struct DepthPictures {
  /// Depth map with one pixel per green subpixel: grey within the depth of field, white at the
  /// panel; yellow to red in front, cyan to blue behind, by the number of times the depth doubles,
  /// up to eight times; black if nothing is seen. May be null.
  frames::WovenFrame* map = nullptr;
  /// Mask per subpixel: 255 if the subpixel sees content beyond the depth of field, or nothing;
  /// otherwise 0. May be null.
  frames::WovenFrame* beyond = nullptr;
};

/// Measures every subpixel of a frame by the row sweep. `threads` is the number of threads, 0 = all
/// cores; the results do not depend on it.
[[nodiscard]] DepthHistogram measure_depth(const optics::OpticalModel& model, const Scene& scene,
                                           int threads, const DepthPictures& pictures = {});

}  // namespace lenticule::render
