// SPDX-License-Identifier: Apache-2.0
// Checks that the bytes of frames depend neither on the tiles that the same thread has rendered
// before, nor on the rays that culling saves.
#include <gtest/gtest.h>

#include <vector>

#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "optics/rig_file.h"
#include "render/methods/method.h"
#include "render/scene/scene.h"

namespace lenticule::test {
namespace {

constexpr uint64_t kFrames = 8;

optics::Rig tiny_rig() { return optics::load_rig(LENTICULE_SOURCE_DIR "/scenes/rigs/tiny.toml"); }

/// Turning teapots as `lenticule render builtin:teapot:1` shows them.
struct Teapots {
  explicit Teapots(const optics::OpticalModel& model)
      : stages(scenes.at(scenes.reference_frame()), render::canvas_of(model), {}) {}

  tools::SceneSequence scenes{"builtin:teapot:1", {30, 1}};
  tools::StageSequence stages;
};

class EveryMethod : public ::testing::TestWithParam<const char*> {};

std::vector<frames::WovenFrame> frames_of(const char* name, const optics::OpticalModel& model,
                                          const render::RenderOptions& options) {
  const Teapots teapots(model);
  const auto method = render::make_method(name, model, options);
  std::vector<frames::WovenFrame> frames;
  for (uint64_t n = 0; n < kFrames; ++n) {
    const render::SceneDescription description = teapots.scenes.at(n);
    const render::Stage stage = teapots.stages.at(description);
    const render::Scene scene(description, stage, {}, options.threads);
    frames.emplace_back(
        frames::FrameGeometry{model.rig().panel.width_px, model.rig().panel.height_px});
    EXPECT_TRUE(method->render(scene, stage, frames.back()).completed);
  }
  return frames;
}

TEST_P(EveryMethod, HasTheSameBytesForAnyThreadsOrderAndCulling) {
  const optics::OpticalModel model(tiny_rig());
  const auto expected =
      frames_of(GetParam(), model, {.threads = 1, .use_shaft_culling = false, .cancelled = {}});
  for (const int threads : {1, 2, 4})
    for (const bool backwards : {false, true})
      EXPECT_TRUE(frames_of(GetParam(), model,
                            {.threads = threads, .tiles_backwards = backwards, .cancelled = {}}) ==
                  expected)
          << threads << " threads, tiles backwards: " << backwards;
}

INSTANTIATE_TEST_SUITE_P(TileHistory, EveryMethod,
                         ::testing::Values("full", "adaptive", "lens-view", "interpolate",
                                           "temporal", "hybrid"));

}  // namespace
}  // namespace lenticule::test
