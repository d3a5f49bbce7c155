// SPDX-License-Identifier: Apache-2.0
// Follows the rays of a tile through the scene, a packet of sixteen at a time, each with its shadow
// rays, its mirrored and its refracted rays.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "render/committed_scene.h"
#include "render/method.h"
#include "render/primary_packets.h"
#include "render/ray_stream.h"
#include "render/shading_kernel.h"
#include "render/work_clock.h"

namespace lenticule::render {

struct RayCounts {
  uint64_t primary = 0;
  uint64_t secondary = 0;
  uint64_t shadow = 0;
  uint64_t invalid = 0;

  RayCounts& operator+=(const RayCounts& other);
};

/// Scratch of one thread; keeps its memory from tile to tile.
class PacketTracer {
 public:
  explicit PacketTracer(const RenderOptions& options);
  ~PacketTracer();
  PacketTracer(PacketTracer&&) noexcept;

  /// Adds to light[target] what the primary rays of the tile that `maker` was started with bring,
  /// each `weight` times; a ray's target is its row * columns + column. Everything is added in an
  /// order that depends on the rays alone. Calling thread must flush denormals.
  void trace(const Scene::Impl& scene, const TilePlan& plan, const Tile& tile, double weight,
             PrimaryPackets::Maker& maker, std::span<double> light);

  [[nodiscard]] const RayCounts& counts() const { return counts_; }
  [[nodiscard]] WorkClock& clock() { return clock_; }

 private:
  /// What is needed of one generation of rays while the next is followed.
  struct Generation;
  /// Of the packet that is being traced.
  struct Lanes {
    alignas(64) int32_t channel[kPacket];
    alignas(64) float light[kPacket];
    RTCRay16 shadow;
    alignas(64) int shadow_valid[kPacket];
  };

  void shade(const Scene::Impl& scene, const RayPacket& packet, const float* weight, size_t depth);
  void add_backdrop(const Scene::Impl& scene, const RayPacket& packet, const float* weight,
                    const shading_kernel::Surfaces& surfaces);
  void add_lights(const Scene::Impl& scene, const shading_kernel::Surfaces& surfaces,
                  const float* weight);
  void follow_glass(const Scene::Impl& scene, const RayPacket& packet, Generation& generation,
                    const float* weight, size_t depth);
  void follow(const Scene::Impl& scene, shading_kernel::NewRays& rays, RayPacket& packet,
              size_t depth);

  const shading_kernel::Kernel& kernel_;
  std::vector<RayPacket> primary_;
  std::vector<Generation> generations_;
  Lanes lanes_;
  RayCounts counts_;
  WorkClock clock_;
};

}  // namespace lenticule::render
