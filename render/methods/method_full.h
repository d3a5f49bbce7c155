// SPDX-License-Identifier: Apache-2.0
// Method "full": one ray (or --samples rays) per subpixel, without reuse or interpolation.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "frames/frame.h"
#include "render/culling/background.h"
#include "render/depth_budget/prefilter.h"
#include "render/integrator/packet_tracer.h"
#include "render/methods/method.h"
#include "render/options/render_options.h"
#include "render/rays/primary_packets.h"
#include "render/scene/scene.h"
#include "render/shading/shading_kernel.h"

namespace lenticule::render {

/// LastFrame serves one render method whose rig and options do not change. Thread safety: one
/// thread at a time.
class LastFrame {
 public:
  /// Returns true if the committed scene would be rendered to the kept bytes.
  [[nodiscard]] bool shows(const Scene& scene) const;
  /// Copies the kept frame, whose errors the copy has.
  RenderStatistics copy_to(frames::WovenFrame& frame) const;

  [[nodiscard]] const frames::WovenFrame& frame() const { return frame_; }

  /// Keeps the complete frame to which the scene was rendered, and its errors.
  void keep(const Scene& scene, const frames::WovenFrame& frame, const FrameErrors& errors);

 private:
  bool known_ = false;
  Fingerprint picture_;
  std::vector<std::shared_ptr<const Texture>> textures_;
  std::shared_ptr<const Texture> environment_;
  frames::WovenFrame frame_;
  FrameErrors errors_;
};

/// FullTiles holds the tile data of one rig. The bytes of a tile depend on the scene and the tile
/// only. Thread safety: immutable after construction, usable from any thread.
class FullTiles {
 public:
  /// Lifetime: the model must outlive the object.
  FullTiles(const optics::OpticalModel& model, const RenderOptions& options);
  FullTiles(const FullTiles&) = delete;
  FullTiles& operator=(const FullTiles&) = delete;

  [[nodiscard]] const TilePlan& plan() const { return plan_; }
  [[nodiscard]] const PrimaryPackets& packets() const { return packets_; }
  [[nodiscard]] size_t samples() const { return samples_.size(); }

  /// Worker renders tiles of one scene. Thread safety: used by one thread. It keeps its memory from
  /// tile to tile.
  class Worker {
   public:
    /// Lifetime: all arguments must outlive the object.
    Worker(const FullTiles& tiles, const Scene& scene, const BeamTester& beams);
    Worker(const Worker&) = delete;
    Worker& operator=(const Worker&) = delete;

    /// Renders the tile's subpixels into the frame.
    void render(const Tile& tile, frames::WovenFrame& frame);

    /// Returns the counters of rays and of averaged subpixels.
    [[nodiscard]] FrameCounts counts() const;
    [[nodiscard]] const std::array<uint64_t, kWorks>& ticks() { return tracer_.clock().ticks(); }

   private:
    void trace(const Tile& tile, PacketTracer::FootprintSample sample);
    void write(const Tile& tile, frames::WovenFrame& frame) const;

    const FullTiles& tiles_;
    const Scene& scene_;
    const BeamTester& beams_;
    PrimaryPackets::Maker maker_;
    Background background_;
    uint64_t refused_ = 0;
    std::vector<float> light_;
    PacketTracer tracer_;
    std::optional<DepthPrefilter::Worker> prefilter_;
  };

 private:
  RenderOptions options_;
  TilePlan plan_;
  PrimaryPackets packets_;
  const shading_kernel::Kernel& kernel_;
  std::vector<Footprint> samples_;
  std::optional<DepthPrefilter> prefilter_;
};

[[nodiscard]] std::unique_ptr<Method> make_method_full(const optics::OpticalModel& model,
                                                       const RenderOptions& options);
/// Makes the method with tiles that were made for the same rig and options.
[[nodiscard]] std::unique_ptr<Method> make_method_full(std::shared_ptr<const FullTiles> tiles,
                                                       const optics::Rig& rig,
                                                       const RenderOptions& options);

}  // namespace lenticule::render
