// SPDX-License-Identifier: Apache-2.0
// Probe traces single rays through a committed scene as method full does, to test for holes, false
// shadows and wrong rays.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/cpu.h"
#include "optics/model.h"
#include "render/scene/scene.h"

namespace lenticule::bench {

/// A ray in the scene frame: millimetres on the panel; the origin is the centre of the scene
/// placement.
struct ProbeRay {
  Vec3 origin;
  Vec3 direction;  ///< unit vector
};

struct ProbeHit {
  enum class What { Nothing, Surface, Refused } what = What::Refused;
  double distance = 0.0;  ///< infinite for Nothing
  Vec3 point{};
  Vec3 geometric_normal{};  ///< unit, on the side from which the ray came
  bool outer_side = false;
  Vec3 spawn_point{};  ///< start of rays that leave toward the viewer
  uint32_t geometry = 0;
  uint32_t primitive = 0;
};

/// Enables the search for rays that pass between triangles, as method full does it.
enum class HoleGuard { Off, On };

/// Thread safety: any thread. Lifetime: the scene must outlive the probe.
class Probe {
 public:
  explicit Probe(const render::Scene& scene);

  /// Traces rays; sixteen consecutive rays form a packet and are neighbours for the guard. The
  /// spans have equal lengths. Returns the number of rays that the guard filled.
  uint64_t trace(std::span<const ProbeRay> rays, HoleGuard guard, std::span<ProbeHit> hits) const;

  /// Sets blocked[k] to 1 if an object lies between hit k and infinity along its direction, else to
  /// 0. Hits that are not surfaces are not blocked. The spans have equal lengths.
  void leave(std::span<const ProbeHit> hits, std::span<const Vec3> directions,
             std::span<uint8_t> blocked) const;

  /// Returns the corners of a mesh as Embree stores them, in the order of the description.
  [[nodiscard]] std::vector<Vec3> corners(size_t mesh) const;

 private:
  const render::Scene& scene_;
};

/// PrimaryProbe returns the primary rays of method full in the panel frame. Thread safety: any
/// thread.
class PrimaryProbe {
 public:
  PrimaryProbe(const render::Scene& scene, const optics::OpticalModel& model, Isa isa);
  ~PrimaryProbe();
  PrimaryProbe(const PrimaryProbe&) = delete;
  PrimaryProbe& operator=(const PrimaryProbe&) = delete;

  struct Line {
    int row = 0;
    int subpixel = 0;  ///< 3 i + channel
    double x_mm = 0.0, y_mm = 0.0;
    double tan_x = 0.0, tan_y = 0.0;
  };
  [[nodiscard]] int tiles() const;
  /// Returns true if the rays come from this rig's polynomials, false if from the optical map
  /// itself.
  [[nodiscard]] bool fast() const;
  /// Returns one line for each subpixel of the tile that is on the panel; every subpixel is in
  /// exactly one tile.
  void lines(int tile, std::vector<Line>& out) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lenticule::bench
