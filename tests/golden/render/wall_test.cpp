// SPDX-License-Identifier: Apache-2.0
// Compares the panels of a wall with the reference implementation, with one large panel, and with
// each other where they meet.
#include "optics/wall/wall.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "render/methods/method.h"
#include "render/scene/surroundings.h"
#include "tests/support/oracles/reference_renderer.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::test {
namespace {

frames::WovenFrame rendered(const render::SceneDescription& description, const render::Stage& stage,
                            const optics::OpticalModel& model, const char* method = "full") {
  const render::Scene scene(description, stage, {});
  frames::WovenFrame frame({model.rig().panel.width_px, model.rig().panel.height_px});
  const auto made = render::make_method(method, model, {.threads = 2, .cancelled = {}});
  EXPECT_TRUE(made->render(scene, stage, frame).completed);
  return frame;
}

/// Half is one panel of a wall, with its own stage.
struct Half {
  Half(const optics::Rig& rig, const optics::WallPanel& place, Vec3 viewer_mm,
       const render::Stage& canvas)
      : wall_from_panel(optics::wall_from_panel(place)),
        model(seen_by(rig, viewer_mm, wall_from_panel)),
        stage(render::stage_of_panel(canvas, wall_from_panel, place.name)) {}

  static optics::Rig seen_by(optics::Rig rig, Vec3 viewer_mm, const Affine& wall_from_panel) {
    const Vec3 viewer = wall_from_panel.inverse().point(viewer_mm);
    rig.viewing = {.height = Millimetres(viewer.y),
                   .distance = Millimetres(viewer.z),
                   .centre = Millimetres(viewer.x)};
    return rig;
  }

  Affine wall_from_panel;
  optics::OpticalModel model;
  render::Stage stage;
};

constexpr Vec3 kViewer{20.0, 30.0, 600.0};

/// Two panels of 60 x 40 mm that face the viewer.
std::vector<optics::WallPanel> turned_places() {
  return {{.name = "left",
           .rig = "",
           .centre_mm = {-30.0, 1.0, 2.0},
           .turn_degrees = 15.0,
           .tilt_degrees = -4.0,
           .roll_degrees = 2.0},
          {.name = "right", .rig = "", .centre_mm = {30.0, -1.0, 3.0}, .turn_degrees = -20.0}};
}

/// Returns the code value on the ray of a subpixel, from the wall's frame and the canvas's stage:
/// the reference does not know panels of walls.
double code_on_the_wall(const NamedScene& named, const render::Stage& canvas, const Half& half,
                        int i, int j, int channel, double move_mm = 0.0) {
  const optics::SubpixelRay ray = half.model.ray(i, j, channel);
  const Affine& map = half.wall_from_panel;
  const Vec3 at = map.point({ray.lens_x_mm + move_mm, ray.lens_y_mm + move_mm / 3.0, 0.0});
  const Vec3 way = map.vector({ray.tan_x, ray.tan_y, 1.0});
  const double tan_x = way.x / way.z, tan_y = way.y / way.z;
  constexpr double kBeforeAll = 300.0;
  const double light = reference_light(
      named.scene, canvas,
      {.x_mm = at.x - at.z * tan_x, .y_mm = at.y - at.z * tan_y, .tan_x = tan_x, .tan_y = tan_y},
      kBeforeAll, channel);
  return reference_code(light, named.scene.colour_managed);
}

class WallAgainstReference : public ::testing::TestWithParam<NamedScene> {};

TEST_P(WallAgainstReference, EverySubpixelOfTurnedPanelsIsEqual) {
  const NamedScene& named = GetParam();
  int subpixels = 0, on_edges = 0, lit = 0;
  for (const double depth_scale : {1.0, 0.6}) {
    const render::Stage canvas = make_tiny_stage(
        {.centre = {0.05, 0.1, -0.2}, .depth_scale = depth_scale, .turn_degrees = 12.0});
    for (const optics::WallPanel& place : turned_places()) {
      const Half half(make_rig({.width = 24, .height = 16, .pixel_mm = 2.5}), place, kViewer,
                      canvas);
      const frames::WovenFrame frame = rendered(named.scene, half.stage, half.model);
      for (int s = 0; s < 3 * frame.width() * frame.height(); ++s) {
        const int i = s / 3 % frame.width(), j = s / 3 / frame.width(), c = s % 3;
        const int code = frame.row(j)[3 * i + c];
        const auto differs = [&](double move_mm) {
          return std::abs(code_on_the_wall(named, canvas, half, i, j, c, move_mm) - code) > 1.0;
        };
        ++subpixels;
        const Vec3 back = named.scene.background;
        if (std::abs(code - 255.0 * (c == 0 ? back.x : c == 1 ? back.y : back.z)) > 2.0) ++lit;
        if (!differs(0.0)) continue;
        ++on_edges;
        EXPECT_FALSE(differs(1e-4) && differs(-1e-4))
            << named.name << " panel " << place.name << " subpixel " << i << ", " << j << ", " << c
            << ": reference " << code_on_the_wall(named, canvas, half, i, j, c) << ", full "
            << code;
      }
    }
  }
  EXPECT_GT(lit, subpixels / 5);
  EXPECT_LE(on_edges, subpixels / 1000);
}

TEST_P(WallAgainstReference, EveryMethodRendersTurnedPanels) {
  const NamedScene& named = GetParam();
  const render::Stage canvas = make_tiny_stage({.depth_scale = 0.6, .turn_degrees = 12.0});
  const Half half(make_rig({.width = 96, .height = 64, .pixel_mm = 0.625}), turned_places()[0],
                  kViewer, canvas);
  const frames::WovenFrame full = rendered(named.scene, half.stage, half.model);
  for (const char* method : {"adaptive", "lens-view", "interpolate", "temporal", "hybrid"}) {
    const frames::WovenFrame frame = rendered(named.scene, half.stage, half.model, method);
    double squares = 0.0;
    for (size_t n = 0; n < full.bytes().size(); ++n)
      squares += std::pow(int{full.bytes()[n]} - int{frame.bytes()[n]}, 2);
    const double rmse = std::sqrt(squares / static_cast<double>(full.bytes().size()));
    RecordProperty(method, std::to_string(rmse));
    std::printf("%s, %s: RMSE %.3f\n", named.name.c_str(), method, rmse);
    EXPECT_LT(rmse, 6.0) << method;
  }
}

INSTANTIATE_TEST_SUITE_P(TinyScenes, WallAgainstReference, ::testing::ValuesIn(tiny_scenes()),
                         [](const auto& instance) { return instance.param.name; });

// ---- a panel cut in two at a whole lens

/// A panel of 20 whole lenses, 60 mm wide.
optics::Rig whole_rig() {
  return make_rig({.width = 48, .height = 32, .pitch_subpx = 7.2, .pixel_mm = 1.25});
}

struct CutWall {
  explicit CutWall(const render::Stage& canvas)
      : left(half_rig(), {.name = "left", .rig = "", .centre_mm = {-15.0, 0.0, 0.0}}, kViewer,
             canvas),
        right(half_rig(), {.name = "right", .rig = "", .centre_mm = {15.0, 0.0, 0.0}}, kViewer,
              canvas) {}
  /// Returns a half; the cut lies five lenses from its centre, so that the offset is that of the
  /// whole.
  static optics::Rig half_rig() {
    optics::Rig rig = whole_rig();
    rig.panel.width_px /= 2;
    return rig;
  }
  Half left, right;
};

/// Puts two frames beside each other.
frames::WovenFrame joined(const frames::WovenFrame& left, const frames::WovenFrame& right) {
  frames::WovenFrame both({left.width() + right.width(), left.height()});
  for (int j = 0; j < left.height(); ++j) {
    std::copy_n(left.row(j), 3 * left.width(), both.row(j));
    std::copy_n(right.row(j), 3 * right.width(), both.row(j) + 3 * left.width());
  }
  return both;
}

optics::OpticalModel whole_model() {
  return optics::OpticalModel(Half::seen_by(whole_rig(), kViewer, {}));
}

TEST(WallOfTwoHalves, DiffersFromTheWholePanelByRoundingOnly) {
  for (const NamedScene& named : tiny_scenes()) {
    const render::Stage canvas = make_tiny_stage({.depth_scale = 0.7, .turn_degrees = 10.0});
    const CutWall wall(canvas);
    const auto pair = joined(rendered(named.scene, wall.left.stage, wall.left.model),
                             rendered(named.scene, wall.right.stage, wall.right.model));
    const auto whole = rendered(named.scene, canvas, whole_model());
    int differ = 0, by_more = 0;
    for (size_t n = 0; n < whole.bytes().size(); ++n) {
      const int apart = std::abs(int{pair.bytes()[n]} - int{whole.bytes()[n]});
      differ += apart > 0 ? 1 : 0;
      by_more += apart > 1 ? 1 : 0;
    }
    std::printf("%s: %d of %zu differ, %d by more than one\n", named.name.c_str(), differ,
                whole.bytes().size(), by_more);
    EXPECT_LE(differ, static_cast<int>(whole.bytes().size() / 500)) << named.name;
    EXPECT_LE(by_more, 3) << named.name;  // on edges
  }
}

TEST(WallStage, LightAndBackdropAreTheSameOnAllPanels) {
  const render::Stage canvas = make_tiny_stage({.depth_scale = 0.6, .turn_degrees = 12.0});
  const render::SceneDescription scene;
  const render::Backdrop expected = render::make_backdrop(scene, canvas, {});
  for (const optics::WallPanel& place : turned_places()) {
    const render::Stage stage =
        render::stage_of_panel(canvas, optics::wall_from_panel(place), place.name);
    const Vec3 sun{0.3, 0.8, 0.5};
    EXPECT_LT(length(render::world_direction(stage, sun) - render::world_direction(canvas, sun)),
              1e-12);
    const render::Backdrop backdrop = render::make_backdrop(scene, stage, {});
    EXPECT_EQ(backdrop.up, expected.up);
    EXPECT_LT(length(backdrop.ahead - expected.ahead), 1e-12);
  }
}

TEST(WallStage, RefusesTurnedPanelsIfTheCameraCutsOffContent) {
  render::Stage canvas = make_tiny_stage();
  canvas.cuts_in_front = true;
  canvas.near_mm = 10.0;
  optics::WallPanel place{.name = "left", .rig = "", .centre_mm = {-15.0, 0.0, 2.0}};
  const render::Stage straight =
      render::stage_of_panel(canvas, optics::wall_from_panel(place), place.name);
  EXPECT_EQ(straight.near_mm, 8.0);
  place.turn_degrees = 1.0;
  try {
    (void)render::stage_of_panel(canvas, optics::wall_from_panel(place), place.name);
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("left"), std::string::npos);
    EXPECT_NE(error.hint().find("--fit"), std::string::npos);
  }
}

}  // namespace
}  // namespace lenticule::test
