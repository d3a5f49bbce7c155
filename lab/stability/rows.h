// SPDX-License-Identifier: Apache-2.0
// StabilityCase is an entry of the table of `lenticule bench stability`, StabilityRow what one run
// of it found. Tally counts failures, and the small scenes are what the cases render.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "frames/frame.h"
#include "optics/rig.h"
#include "render/methods/method.h"
#include "render/scene/scene.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::lab {

struct StabilitySize {
  bool full = false;
  int threads = 0;  ///< 0 = all cores

  /// Returns the number of samples of a row.
  [[nodiscard]] uint64_t samples(uint64_t quick, uint64_t in_full) const {
    return full ? in_full : quick;
  }
};

/// Tally counts the samples of a row that failed, and has the largest error.
struct Tally {
  uint64_t samples = 0;
  uint64_t failures = 0;
  double worst = 0.0;

  /// Records an error; NaN counts as infinite.
  void error(double size) {
    worst = std::max(worst, std::isnan(size) ? std::numeric_limits<double>::infinity() : size);
  }
  void check(bool good) {
    ++samples;
    if (!good) ++failures;
  }
  Tally& operator+=(const Tally& other) {
    samples += other.samples;
    failures += other.failures;
    worst = std::max(worst, other.worst);
    return *this;
  }
};

struct StabilityCase;

struct StabilityRow {
  const StabilityCase* of = nullptr;
  Tally tally{};
  uint64_t failures_allowed = 0;
  std::string note{};  ///< further figures; empty = none
};

struct StabilityCase {
  const char* name;          ///< name for --row
  const char* stressed;      ///< stressed property, for people
  const char* samples_are;   ///< "rays", "subpixels"
  const char* failures_are;  ///< "wrong lenses"
  /// Throws Error(Failed) if the measurement is not possible.
  StabilityRow (*run)(const StabilitySize& size);
  double bound = 0.0;     ///< limit of the largest error; 0 if the row only counts failures
  const char* unit = "";  ///< unit of the error
};

/// Returns every case, in the order of the table.
[[nodiscard]] const std::vector<StabilityCase>& stability_cases();

/// Returns true if the row is within its limits. A row without samples and an error that is NaN do
/// not pass.
[[nodiscard]] bool passes(const StabilityRow& row);

struct StabilityReport {
  bool full = false;
  double seconds = 0.0;
  std::vector<StabilityRow> rows{};
};

/// Returns true if there are rows and all of them pass.
[[nodiscard]] bool passes(const StabilityReport& report);

[[nodiscard]] nlohmann::json to_json(const StabilityReport& report);
/// Returns one line per row and a summary line.
[[nodiscard]] std::string to_text(const StabilityReport& report);

/// Calls work(k) for k in [0, count) from several threads, in any order; stops early when the
/// program is interrupted. Rethrows the first exception.
void for_each_part(const StabilitySize& size, uint64_t count,
                   const std::function<void(uint64_t)>& work);
/// Does the same and adds up the tallies of the parts. The result does not depend on the order:
/// sums of integers, and a maximum.
[[nodiscard]] Tally tally_parts(const StabilitySize& size, uint64_t count,
                                const std::function<void(uint64_t, Tally&)>& work);

/// NamedFailures records checks with names, for the note of a row.
class NamedFailures {
 public:
  void check(const std::string& name, bool good) {
    tally.check(good);
    if (!good) names_ += (names_.empty() ? "failed: " : ", ") + name;
  }
  /// Returns the names of failed checks; empty if none failed.
  [[nodiscard]] const std::string& names() const { return names_; }

  Tally tally;

 private:
  std::string names_;
};

// Scenes, scene placements and rigs that the rows of `bench stability` share.

/// Returns a placement whose world units are millimetres on the panel; `centre` is in the panel's
/// middle. Clips nothing.
[[nodiscard]] render::Stage plain_stage(Vec3 centre = {}, double mm_per_unit = 1.0);

/// One triangle slightly in front of the panel, for tests that need rays and no picture.
struct PlainStage {
  explicit PlainStage(const optics::Rig& rig);
  render::Scene scene;
};

/// Returns a closed ball of triangles, with many corners at which 2 * `rings` triangles meet; no
/// normals.
[[nodiscard]] render::TriangleMesh ball_mesh(Vec3 centre, double radius, uint32_t rings);
/// Returns a flat rectangle of `side` x `side` squares of two triangles; its front is cross(a, b).
[[nodiscard]] render::TriangleMesh grid_mesh(Vec3 corner, Vec3 a, Vec3 b, uint32_t side);
[[nodiscard]] render::TriangleMesh box_mesh(Vec3 low, Vec3 high, int material);

/// Returns a rig with a panel of coarse pixels, 160x96, seen from 400 mm.
[[nodiscard]] optics::Rig small_rig();

/// Returns a scene with every kind of object: meshes, spheres, cones, mirrors, transparent objects,
/// shadows; about 6 units wide.
[[nodiscard]] render::SceneDescription mixed_scene();

/// Returns the scene scaled about the origin and then moved.
[[nodiscard]] render::SceneDescription moved(render::SceneDescription scene, double scale,
                                             Vec3 offset);

/// Renders one frame with method full. Throws Error(Failed) if a ray was not finite.
[[nodiscard]] frames::WovenFrame render_small(const render::SceneDescription& scene,
                                              const render::Stage& stage, const optics::Rig& rig,
                                              int threads);

struct SmallFrame {
  frames::WovenFrame frame;
  render::RenderStatistics statistics;
};
/// Renders the method's next frame; `rig` is the rig of the method. Throws Error(Failed) if a ray
/// was not finite.
[[nodiscard]] SmallFrame next_frame(render::Method& method, const render::Scene& scene,
                                    const render::Stage& stage, const optics::Rig& rig);

/// Returns the same panel with `times` as many pixels along each side.
[[nodiscard]] optics::Rig finer(optics::Rig rig, int times);

/// Returns a material that only emits light.
[[nodiscard]] render::Material glowing(Vec3 colour);
/// Returns a scene for such materials: no lights, no ambient light.
[[nodiscard]] render::SceneDescription dark_scene(Vec3 background);
}  // namespace lenticule::lab
