// SPDX-License-Identifier: Apache-2.0
// A scene committed to Embree: immutable, shared by all threads.
#pragma once

#include <memory>

#include "render/scene_description.h"
#include "render/stage.h"

namespace lenticule::render {

/// Optional surroundings that a file need not have.
struct Surroundings {
  std::optional<Vec3> background;        ///< replaces the scene's
  bool sky = false;                      ///< vertical gradient instead of a flat background
  std::string environment_file;          ///< latitude-longitude picture, empty = none
  bool ground = false;                   ///< a plane under the scene
  Vec3 ground_colour{0.5, 0.5, 0.5};
};

/// Built from a description without nodes (at_time). Coordinates inside are re-centred on the stage
/// so that far-away scenes keep their precision.
class Scene {
 public:
  Scene(const SceneDescription& description, const Stage& stage, const Surroundings& surroundings);
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  struct Impl;
  [[nodiscard]] const Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace lenticule::render
