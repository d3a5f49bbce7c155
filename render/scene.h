// SPDX-License-Identifier: Apache-2.0
// A scene committed to Embree: immutable, shared by all threads.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "render/scene_description.h"
#include "render/stage.h"

namespace lenticule::render {

/// Optional surroundings that a file need not have.
struct Surroundings {
  std::optional<Vec3> background;  ///< replaces the scene's
  bool sky = false;                ///< vertical gradient instead of a flat background
  std::string environment_file;    ///< latitude-longitude picture, empty = none
  bool ground = false;             ///< a plane under the scene
  Vec3 ground_colour{0.5, 0.5, 0.5};
};

/// Lights that bring nothing to anything (render/skips/idle_lights.h): the picture is the same.
enum class IdleLights { LeaveOut, Keep };

/// Built from a description without nodes (at_time). Coordinates inside are re-centred on the stage
/// so that far-away scenes keep their precision.
class Scene {
 public:
  /// `threads` build the acceleration structures, 0 = all cores; the picture does not depend on it.
  /// Throws Error(Input) "source: object: cause" for numbers that are not finite, sizes that are
  /// not positive, indices out of range and surroundings that cannot be read; Error(Failed) for
  /// Embree's.
  Scene(const SceneDescription& description, const Stage& stage, const Surroundings& surroundings,
        int threads = 0, IdleLights idle_lights = IdleLights::LeaveOut);
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  struct Impl;  ///< render/committed_scene.h
  [[nodiscard]] const Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace lenticule::render
