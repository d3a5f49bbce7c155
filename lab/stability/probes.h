// SPDX-License-Identifier: Apache-2.0
// Other ways to the visibility that method full computes: Probe traces single rays through a
// committed scene, RowTracer a row of pixels with Embree, and time_visibility() measures the speed
// against Embree alone.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/cpu.h"
#include "optics/model.h"
#include "optics/row_rays.h"
#include "render/accel/ray_stream.h"
#include "render/rays/primary_packets.h"
#include "render/rays/primary_rays.h"
#include "render/row_sweep/row_sweep.h"
#include "render/scene/scene.h"

namespace lenticule::lab {

/// ShadowRay is a ray toward a light. Its `light` is added to `target` if the ray is unoccluded.
struct ShadowRay {
  Vec3 origin;
  Vec3 direction;  ///< unit
  double distance = 0.0;
  double light = 0.0;
  uint32_t target = 0;
};

/// Intersects rays in packets of consecutive rays. Rays that Embree does not accept are not traced;
/// returns their number.
uint64_t intersect(const render::EmbreeScene& scene, std::span<const render::PathRay> rays,
                   render::Coherence coherence, std::span<render::Hit> hits);

/// Adds the light of every unoccluded ray, in the order of the rays. Returns the number of
/// non-finite rays, which add nothing.
uint64_t add_unshadowed(const render::EmbreeScene& scene, std::span<const ShadowRay> rays,
                        std::span<double> light);

// Probe traces single rays through a committed scene as method full does, to test for holes, false
// shadows and wrong rays.

/// A ray in the scene frame.
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
  PrimaryProbe(const render::Scene& scene, const optics::OpticalModel& model, Isa isa)
      : scene_(scene), plan_(model.rig()), packets_(model, plan_, isa), footprint_(model, {}) {}

  struct Line {
    int row = 0;
    int subpixel = 0;  ///< 3 i + channel
    double x_mm = 0.0, y_mm = 0.0;
    double tan_x = 0.0, tan_y = 0.0;
  };
  [[nodiscard]] int tiles() const { return plan_.count(); }
  /// Returns true if the rays come from this rig's polynomials, false if from the optical map
  /// itself.
  [[nodiscard]] bool fast() const { return packets_.fast(); }
  /// Returns one line for each subpixel of the tile that is on the panel; every subpixel is in
  /// exactly one tile.
  void lines(int tile, std::vector<Line>& out) const;

 private:
  const render::Scene& scene_;
  render::TilePlan plan_;
  render::PrimaryPackets packets_;
  render::Footprint footprint_;
};

// RowTracer traces a pixel row with Embree, as a reference for the row sweep.

/// Thread safety: one thread.
class RowTracer {
 public:
  /// Lifetime: both must outlive the tracer.
  RowTracer(const optics::OpticalModel& model, const render::Scene& scene);

  struct Seen {
    std::vector<render::Hit> hits;  ///< one per subpixel
    std::vector<double> z_mm;       ///< panel frame; set where a surface was hit
    optics::RowRays rays;
  };
  /// Traces the centre rays of all subpixels of a row, computed from the optical map itself.
  void trace(int row, Seen& out);

 private:
  const optics::OpticalModel& model_;
  const render::Scene& scene_;
  optics::RowRayEvaluator evaluator_;
  double start_mm_;
  std::vector<render::PathRay> rays_;
};

struct SweepDifference {
  uint64_t subpixels = 0;
  uint64_t other_id = 0;       ///< another surface, or only one of the two found a surface
  uint64_t one_sees_none = 0;  ///< part of those: only one found a surface
  uint64_t elsewhere = 0;      ///< part of those: the depths also differ by more than 0.01 mm
  double depth_mm = 0.0;       ///< largest difference of z where both found the same surface
};
/// Compares every `step`-th row, from `first` on, with Embree.
[[nodiscard]] SweepDifference compare_with_embree(const render::RowPlanes& planes,
                                                  const render::Scene& scene, int first, int step);

// Measures the speed of visibility against Embree alone with the same rays, for `lenticule bench
// exact`.

struct VisibilityTiming {
  uint64_t rays = 0;
  double bare_seconds = 0.0;  ///< Embree alone, on packets prepared in advance
  double pass_seconds = 0.0;  ///< subpixels to hits: ray set-up, checks, Embree
};

/// Traces the centre ray of every subpixel once with each method, interleaved. `threads` 0 = all
/// cores. Times are the sum over the threads divided by their number.
[[nodiscard]] VisibilityTiming time_visibility(const render::Scene& scene,
                                               const optics::OpticalModel& model, int threads);
}  // namespace lenticule::lab
