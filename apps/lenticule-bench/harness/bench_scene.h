// SPDX-License-Identifier: Apache-2.0
// A scene set up for one rig as `render` does it: what every benchmark of rendering begins with.
#pragma once

#include <string>

#include "frames/frame.h"
#include "optics/model.h"
#include "optics/rig.h"
#include "render/make_method.h"
#include "render/scene/scene.h"
#include "render/scene/stage.h"

namespace lenticule::player {

struct BenchSetup {
  std::string scene;  ///< as for render
  optics::Rig rig;
  int lights = 0;   ///< those beyond this many are dropped; 0 = none is
  int threads = 0;  ///< 0 = all cores
};

class BenchScene {
 public:
  /// Throws where loading, staging and committing do.
  explicit BenchScene(const BenchSetup& setup);
  BenchScene(const BenchScene&) = delete;
  BenchScene& operator=(const BenchScene&) = delete;

  [[nodiscard]] const BenchSetup& setup() const { return setup_; }
  [[nodiscard]] const optics::OpticalModel& model() const { return model_; }
  /// Without the lights that were dropped.
  [[nodiscard]] const render::SceneDescription& description() const { return description_; }
  [[nodiscard]] const render::Scene& scene() const { return scene_; }
  [[nodiscard]] int dropped_lights() const { return dropped_lights_; }
  [[nodiscard]] uint64_t primitives() const;
  [[nodiscard]] uint64_t subpixels() const;

  /// The setup's threads and interruption are filled in.
  [[nodiscard]] render::RenderOptions options(int max_depth) const;
  /// Method "full"; the options' threads and interruption are taken as they are.
  [[nodiscard]] std::unique_ptr<render::Method> method(const render::RenderOptions& options) const;
  /// One frame, which frame() shows until the next.
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

/// A built-in scene's name may stand for builtin:NAME.
[[nodiscard]] std::string bench_scene_name(const std::string& name);

}  // namespace lenticule::player
