// SPDX-License-Identifier: Apache-2.0
// Single rays through a committed scene, followed as method full follows them, for whoever looks
// for holes, false shadows and wrong rays instead of pictures.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/cpu.h"
#include "optics/model.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// In the scene frame: millimetres on the glass, the stage's centre is the origin.
struct ProbeRay {
  Vec3 origin;
  Vec3 direction;  ///< unit
};

struct ProbeHit {
  enum class What { Nothing, Surface, Refused } what = What::Refused;
  double distance = 0.0;  ///< infinite for Nothing
  Vec3 point{};
  Vec3 geometric_normal{};  ///< unit, on the side the ray came from
  bool outer_side = false;
  Vec3 spawn_point{};  ///< where rays that leave toward the viewer start
  uint32_t geometry = 0;
  uint32_t primitive = 0;
};

/// Whether rays that slip between triangles are looked for, as method full does.
enum class HoleGuard { Off, On };

/// Safe from any thread. The scene must outlive it.
class Probe {
 public:
  explicit Probe(const Scene& scene);

  /// Sixteen consecutive rays make a packet, and are neighbours for the guard. Two spans of one
  /// length. Returns how many rays the guard filled.
  uint64_t trace(std::span<const ProbeRay> rays, HoleGuard guard, std::span<ProbeHit> hits) const;

  /// Sets blocked[k] to 1 where something lies between hit k and infinity along its direction, 0
  /// where not. Hits that are no surface are not blocked. Three spans of one length.
  void leave(std::span<const ProbeHit> hits, std::span<const Vec3> directions,
             std::span<uint8_t> blocked) const;

  /// Corners of a mesh as Embree has them, in the order of the description.
  [[nodiscard]] std::vector<Vec3> corners(size_t mesh) const;

 private:
  const Scene& scene_;
};

/// The primary rays of method full, brought back to the panel frame. Safe from any thread.
class PrimaryProbe {
 public:
  PrimaryProbe(const Scene& scene, const optics::OpticalModel& model, Isa isa);
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
  /// Whether the rays come from polynomials; of this rig, or else from the map itself.
  [[nodiscard]] bool fast() const;
  /// One line for each subpixel of the tile that is on the panel; all tiles have each subpixel
  /// once.
  void lines(int tile, std::vector<Line>& out) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lenticule::render
