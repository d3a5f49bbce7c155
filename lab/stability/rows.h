// SPDX-License-Identifier: Apache-2.0
// StabilityRow is a measurement of `lenticule bench stability` with its limits; a StabilityCase
// measures one. Tally counts its failures, and the small scenes are what it renders.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "frames/frame.h"
#include "optics/rig.h"
#include "render/make_method.h"
#include "render/scene/scene.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::lab {

struct StabilityRow {
  std::string name{};      ///< name for --row
  std::string stressed{};  ///< stressed property, for people
  uint64_t samples = 0;
  std::string samples_are{};  ///< "rays", "subpixels"
  /// Failures must not exceed the allowed number.
  uint64_t failures = 0;
  uint64_t failures_allowed = 0;
  std::string failures_are{};  ///< "wrong lenses"
  /// The largest error relative to the oracle, and its limit; both zero if the row only counts
  /// failures.
  double worst = 0.0;
  double bound = 0.0;
  std::string unit{};  ///< unit of the error
  std::string note{};  ///< further figures; empty = none
};

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

// The rows of `lenticule bench stability`: one function each, one line each in rows.cpp.

struct StabilitySize {
  bool full = false;
  int threads = 0;  ///< 0 = all cores

  /// Returns the number of samples of a row.
  [[nodiscard]] uint64_t samples(uint64_t quick, uint64_t in_full) const {
    return full ? in_full : quick;
  }
};

struct StabilityCase {
  const char* name;
  /// Fills in everything except the name. Throws Error(Failed) if the measurement is not possible.
  StabilityRow (*run)(const StabilitySize& size);
};

/// Returns every row, in the order of the table.
[[nodiscard]] const std::vector<StabilityCase>& stability_cases();

/// Calls work(k) for k in [0, count) from several threads, in any order; stops early when the
/// program is interrupted. Rethrows the first exception.
void for_each_part(const StabilitySize& size, uint64_t count,
                   const std::function<void(uint64_t)>& work);

// Tally sums up the parts of a row on which several threads work.

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

/// SharedTally adds up parts from several threads. The result does not depend on the order: sums of
/// integers, and a maximum.
class SharedTally {
 public:
  void add(const Tally& part) {
    const std::lock_guard lock(mutex_);
    sum_ += part;
  }
  [[nodiscard]] const Tally& sum() const { return sum_; }

 private:
  std::mutex mutex_;
  Tally sum_;
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
