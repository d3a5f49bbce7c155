// SPDX-License-Identifier: Apache-2.0
// BenchScene is a scene prepared for one rig as `render` does it, the start of every rendering
// benchmark.
#pragma once

#include <string>

#include "frames/frame.h"
#include "optics/model.h"
#include "optics/rig.h"
#include "render/make_method.h"
#include "render/scene/scene.h"
#include "render/scene/stage.h"

namespace lenticule::bench {

struct BenchSetup {
  std::string scene;  ///< a scene as for render
  optics::Rig rig;
  int lights = 0;   ///< maximum number of lights; the rest is dropped; 0 = no limit
  int threads = 0;  ///< 0 = all cores
};

class BenchScene {
 public:
  /// Throws the errors of loading, placing and committing the scene.
  explicit BenchScene(const BenchSetup& setup);
  BenchScene(const BenchScene&) = delete;
  BenchScene& operator=(const BenchScene&) = delete;

  [[nodiscard]] const BenchSetup& setup() const { return setup_; }
  [[nodiscard]] const optics::OpticalModel& model() const { return model_; }
  /// Returns the description without the dropped lights.
  [[nodiscard]] const render::SceneDescription& description() const { return description_; }
  [[nodiscard]] const render::Scene& scene() const { return scene_; }
  [[nodiscard]] int dropped_lights() const { return dropped_lights_; }
  [[nodiscard]] uint64_t primitives() const;
  [[nodiscard]] uint64_t subpixels() const;

  /// Returns options with the setup's threads and interruption.
  [[nodiscard]] render::RenderOptions options(int max_depth) const;
  /// Returns method "full" with the given options, including threads and interruption.
  [[nodiscard]] std::unique_ptr<render::Method> method(const render::RenderOptions& options) const;
  /// Renders a frame, which frame() returns until the next call.
  render::RenderStatistics render(render::Method& method);
  [[nodiscard]] const frames::WovenFrame& frame() const { return frame_; }

 private:
  BenchSetup setup_;
  optics::OpticalModel model_;
  int dropped_lights_ = 0;
  render::SceneDescription description_;
  render::Stage stage_;
  render::Scene scene_;
  frames::WovenFrame frame_;
};

/// Returns a scene name, with "builtin:" added to a built-in scene's name.
[[nodiscard]] std::string bench_scene_name(const std::string& name);

}  // namespace lenticule::bench
