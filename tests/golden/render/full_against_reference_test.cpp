// SPDX-License-Identifier: Apache-2.0
// Compares method full with the reference implementation, subpixel by subpixel, on a family of tiny
// rigs.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "render/methods/method.h"
#include "tests/support/oracles/reference_renderer.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

frames::WovenFrame render_full(const render::SceneDescription& description,
                               const render::Stage& stage, const optics::OpticalModel& model,
                               int max_depth = 5) {
  const render::Scene scene(description, stage, {});
  const auto method =
      render::make_method("full", model, {.threads = 2, .max_depth = max_depth, .cancelled = {}});
  frames::WovenFrame frame({model.rig().panel.width_px, model.rig().panel.height_px});
  const render::RenderStatistics statistics = method->render(scene, stage, frame);
  EXPECT_TRUE(statistics.completed);
  EXPECT_EQ(statistics.invalid_rays, 0U);
  EXPECT_EQ(statistics.primary_rays, frame.bytes().size());
  return frame;
}

/// Returns true if an edge is a hundred-thousandth of a millimetre away or less and the reference
/// gives the rendered colour on one of its sides.
bool lies_on_an_edge(const NamedScene& named, const render::Stage& stage,
                     const optics::OpticalModel& model, int i, int j, int channel, int rendered) {
  for (const double x : {-1e-5, 0.0, 1e-5})
    for (const double y : {-1e-5, 0.0, 1e-5})
      for (const double tangent : {-1e-7, 0.0, 1e-7}) {
        const double value =
            reference_subpixel(named.scene, stage, model, i, j, channel,
                               {.move_x_mm = x, .move_y_mm = y, .move_tan = tangent});
        if (std::abs(value - rendered) <= 1.0) return true;
      }
  return false;
}

struct Agreement {
  int subpixels = 0;
  int on_edges = 0;
  int different_by_one = 0;
  int lit = 0;  ///< number of subpixels that show objects, so that the comparison is not empty
};

Agreement compare(const NamedScene& named, const render::Stage& stage, const optics::Rig& rig) {
  const optics::OpticalModel model(rig);
  const frames::WovenFrame frame = render_full(named.scene, stage, model);
  Agreement agreement;
  for (int j = 0; j < frame.height(); ++j)
    for (int i = 0; i < frame.width(); ++i)
      for (int channel = 0; channel < 3; ++channel) {
        const int rendered = frame.row(j)[3 * i + channel];
        const double expected = reference_subpixel(named.scene, stage, model, i, j, channel);
        ++agreement.subpixels;
        if (std::lround(expected) != rendered) ++agreement.different_by_one;
        const Vec3 back = named.scene.background;
        const double empty = channel == 0 ? back.x : channel == 1 ? back.y : back.z;
        if (std::abs(expected - 255.0 * empty) > 2.0) ++agreement.lit;
        if (std::abs(expected - rendered) <= 1.0) continue;
        ++agreement.on_edges;
        EXPECT_TRUE(lies_on_an_edge(named, stage, model, i, j, channel, rendered))
            << named.name << " subpixel " << i << ", " << j << ", " << channel << ": oracle "
            << expected << ", full " << rendered;
      }
  return agreement;
}

class FullAgainstReference : public ::testing::TestWithParam<NamedScene> {};

TEST_P(FullAgainstReference, EverySubpixelOfEveryTinyRigIsEqual) {
  Agreement all;
  int turn = 0;
  for (const double pitch : {2.3, 16.0 / 3.0, 7.7, 24.04})
    for (const double slant : {0.0, 1.0 / 3.0, -0.21, 1.0})
      for (const char* layout : {"rgb", "bgr", "vrgb", "cells"})
        for (const double distance : {kInfinity, 700.0, 290.0}) {
          const optics::Rig rig = make_rig({.pitch_subpx = pitch,
                                            .slant = slant,
                                            .layout = layout,
                                            .distance_mm = distance,
                                            .eye_height_mm = std::isinf(distance) ? 0.0 : 23.0});
          const render::Stage stage =
              make_tiny_stage({.centre = {0.05, 0.1, -0.2 + 0.1 * (turn % 5)},
                               .mm_per_unit = 9.0,
                               .depth_scale = turn % 3 == 0 ? 1.0 : 0.6,
                               .turn_degrees = -20.0 + 7.0 * (turn % 7)});
          ++turn;
          const Agreement one = compare(GetParam(), stage, rig);
          all.subpixels += one.subpixels;
          all.on_edges += one.on_edges;
          all.different_by_one += one.different_by_one;
          all.lit += one.lit;
        }
  RecordProperty("subpixels", all.subpixels);
  RecordProperty("on_edges", all.on_edges);
  RecordProperty("rounded_differently", all.different_by_one);
  EXPECT_GT(all.lit, all.subpixels / 3);
  EXPECT_LE(all.on_edges, all.subpixels / 10000);
  EXPECT_LE(all.different_by_one, all.subpixels / 1000);
  std::printf("%s: %d subpixels, %d on edges, %d rounded differently\n", GetParam().name.c_str(),
              all.subpixels, all.on_edges, all.different_by_one);
}

INSTANTIATE_TEST_SUITE_P(TinyScenes, FullAgainstReference, ::testing::ValuesIn(tiny_scenes()),
                         [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace lenticule::test
