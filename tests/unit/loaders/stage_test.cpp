// SPDX-License-Identifier: Apache-2.0
// Tests the stage: orientation, size and depth, at any scale and place of the scene.
#include "render/scene/stage.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>

#include "tests/support/error_matchers.h"

namespace lenticule::render {
namespace {

using test::error_of;

constexpr double kWidth = 600.0;
constexpr double kHeight = 300.0;

/// Returns a panel of 600 x 300 mm, seen from `distance_mm`; the depth of field follows from the
/// gap.
optics::OpticalModel model(double gap_mm = 2.0, double distance_mm = 700.0) {
  optics::Rig rig;
  rig.panel.width_px = 6000;
  rig.panel.height_px = 3000;
  rig.panel.pixel_width = Millimetres(0.1);
  rig.panel.pixel_height = Millimetres(0.1);
  rig.sheet.pitch = Subpixels(8.0);
  rig.sheet.gap = Millimetres(gap_mm);
  rig.viewing.distance = Millimetres(distance_mm);
  return optics::OpticalModel(rig);
}

TriangleMesh quad(Vec3 a, Vec3 b, Vec3 c, Vec3 d) {
  TriangleMesh mesh;
  mesh.positions = {a, b, c, d};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

/// Returns a square across the view at depth z, half a unit to each side.
TriangleMesh card(double z) {
  return quad({-0.5, -0.5, z}, {0.5, -0.5, z}, {0.5, 0.5, z}, {-0.5, 0.5, z});
}

SceneDescription ball_scene(Vec3 centre = {}, double radius = 1.0) {
  SceneDescription scene;
  scene.source = "ball";
  scene.materials.resize(1);
  Sphere ball;
  ball.centre = centre;
  ball.radius = radius;
  scene.spheres = {ball};
  return scene;
}

Camera camera(Vec3 from, Vec3 at, Vec3 up, double fov) {
  Camera c;
  c.from = from;
  c.at = at;
  c.up = up;
  c.vertical_fov_degrees = fov;
  return c;
}

void expect_near(Vec3 a, Vec3 b, double tolerance = 1e-9) {
  EXPECT_LT(length(a - b), tolerance) << a.x << ' ' << a.y << ' ' << a.z;
}

TEST(StageBounds, CoverSpheresConesAndUsedVertices) {
  SceneDescription scene = ball_scene({10, 0, 0}, 2.0);
  Cone cone;
  cone.base = {0, 0, 0};
  cone.apex = {0, 0, 5};
  cone.base_radius = 3.0;
  cone.apex_radius = 1.0;
  scene.cones = {cone};
  scene.meshes = {card(-1)};
  scene.meshes[0].positions.push_back({999, 999, 999});  // not used by any triangle
  const Box b = scene_bounds(scene);
  expect_near(b.low, {-3, -3, -2});
  expect_near(b.high, {12, 3, 5});
}

TEST(StageWithoutACamera, CentresTheSceneOnThePanelAndFitsItsContent) {
  for (const double pitch : {0.0, 12.0, 90.0}) {
    const Stage stage = make_stage(ball_scene({3, 4, 5}, 2.0), model(), {.pitch_degrees = pitch});
    expect_near(stage.panel_from_world.point({3, 4, 5}), {0, 0, 0});
    // The ball has a diameter of 4 and covers 0.9 of the height.
    EXPECT_NEAR(stage.mm_per_unit, 0.9 * kHeight / 4.0, 1e-9) << pitch;
  }
}

TEST(StageWithoutACamera, IsSeenFromSlightlyAbove) {
  const Stage stage = make_stage(ball_scene(), model(), {.depth_scale = 1.0});
  const double s = stage.mm_per_unit;
  const double angle = kPitchWithoutCamera * std::numbers::pi / 180.0;
  expect_near(stage.panel_from_world.point({0, 1, 0}),
              {0, s * std::cos(angle), s * std::sin(angle)});
  expect_near(stage.panel_from_world.point({0, 0, 1}),
              {0, -s * std::sin(angle), s * std::cos(angle)});
  expect_near(stage.panel_from_world.point({1, 0, 0}), {s, 0, 0});
}

TEST(StageWithoutACamera, AGroundIsSeenAsAPlane) {
  SceneDescription scene = ball_scene();
  scene.meshes = {quad({-2, -1, 2}, {2, -1, 2}, {2, -1, -2}, {-2, -1, -2})};
  const auto height = [&](const StageOptions& options) {
    const Affine map = make_stage(scene, model(), options).panel_from_world;
    return map.point({0, -1, -2}).y - map.point({0, -1, 2}).y;
  };
  EXPECT_GT(height({}), 0.1 * kHeight);
  EXPECT_NEAR(height({.pitch_degrees = 0.0}), 0.0, 1e-9);
}

TEST(StageWithoutACamera, FitsTheSceneAtEveryAngleOfATurn) {
  SceneDescription scene;
  scene.meshes = {quad({-5, -1, 0}, {5, -1, 0}, {5, 1, 0}, {-5, 1, 2})};
  Cone cone;
  cone.base = {0, 0, 6};
  cone.apex = {0, 3, 7};
  cone.base_radius = 0.5;
  scene.cones = {cone};
  const optics::OpticalModel rig = model();
  const Stage whole = make_stage(scene, rig, {.fit_every_turn = true});
  double widest = 0.0;
  double deepest = 0.0;
  for (int turn = 0; turn < 360; turn += 5) {
    const StageOptions options{.mm_per_unit = whole.mm_per_unit,
                               .depth_scale = whole.depth_scale,
                               .turn_degrees = static_cast<double>(turn)};
    const Stage stage = make_stage(scene, rig, options);
    deepest = std::max({deepest, stage.near_mm, -stage.far_mm});
    for (const Vec3 p : scene.meshes[0].positions) {
      const Vec3 mm = stage.panel_from_world.point(p);
      widest = std::max({widest, std::abs(mm.x) / kWidth, std::abs(mm.y) / kHeight});
    }
  }
  EXPECT_LE(widest, 0.45 * (1 + 1e-9));
  EXPECT_LE(deepest, rig.depth_of_field_mm() * (1 + 1e-9));
  EXPECT_GT(deepest, 0.9 * rig.depth_of_field_mm());
}

TEST(StageWithoutACamera, ShrinksTheDepthOnlyToTheBudget) {
  const optics::OpticalModel rig = model();
  const Stage deep = make_stage(ball_scene(), rig);
  EXPECT_LT(deep.depth_scale, 1.0);
  EXPECT_NEAR(deep.near_mm, rig.depth_of_field_mm(), 1e-9);
  EXPECT_NEAR(deep.far_mm, -rig.depth_of_field_mm(), 1e-9);
  SceneDescription flat = ball_scene();
  flat.spheres.clear();
  flat.meshes = {card(0)};
  EXPECT_EQ(make_stage(flat, rig, {.pitch_degrees = 0.0}).depth_scale, 1.0);
  StageOptions half;
  half.depth_budget = 0.5;
  EXPECT_NEAR(make_stage(ball_scene(), rig, half).near_mm, rig.depth_of_field_mm() / 2, 1e-9);
}

TEST(StageWithoutACamera, NothingComesNearerThanHalfwayToTheEye) {
  // A sheet this thick resolves all depths, so that only the eye limits the scene.
  const Stage stage = make_stage(ball_scene(), model(90.0, 100.0));
  EXPECT_GT(stage.depth_of_field_mm, 700.0);
  EXPECT_NEAR(stage.near_mm, 50.0, 1e-9);
  const Stage parallel =
      make_stage(ball_scene(), model(90.0, std::numeric_limits<double>::infinity()));
  EXPECT_EQ(parallel.depth_scale, 1.0);
}

TEST(StageWithACamera, ItsAxesBecomeThePanels) {
  SceneDescription scene = ball_scene();
  // The camera looks along world -x with z up: right is world +y.
  scene.cameras = {camera({10, 0, 0}, {0, 0, 0}, {0, 0, 1}, 40)};
  const Stage stage = make_stage(scene, model());
  const double s = stage.mm_per_unit;
  expect_near(stage.panel_from_world.point({0, 1, 0}), {s, 0, 0});
  expect_near(stage.panel_from_world.point({0, 0, 1}), {0, s, 0});
  const Vec3 toward = stage.panel_from_world.point({1, 0, 0});
  expect_near(toward, {0, 0, s * stage.depth_scale});
}

TEST(StageWithACamera, ItsFieldOfViewSpansTheShorterSide) {
  SceneDescription scene = ball_scene();
  scene.cameras = {camera({0, 0, 10}, {0, 0, 0}, {0, 1, 0}, 40)};
  const double span = 20.0 * std::tan(20.0 * std::numbers::pi / 180.0);
  EXPECT_NEAR(make_stage(scene, model()).mm_per_unit, kHeight / span, 1e-9);
}

TEST(StageWithACamera, AHorizonDoesNotFlattenTheScene) {
  SceneDescription scene = ball_scene();
  scene.cameras = {camera({0, 1, 10}, {0, 0, 0}, {0, 1, 0}, 40)};
  // Hilly ground, which is not taken for a floor.
  for (const double x : {-6.0, 6.0})
    scene.meshes.push_back(
        quad({0, -1.5, 1e6}, {1e6 * x, -1e5, 1e6}, {1e6 * x, -1e5, -1e6}, {0, -1.5, -1e6}));
  const Stage stage = make_stage(scene, model());
  EXPECT_TRUE(stage.subject_mm.empty());
  // The stage counts content up to three times the camera's distance from the panel, so the depth
  // behind the panel is twice that distance.
  const double reach = 2.0 * std::hypot(1.0, 10.0) * stage.mm_per_unit;
  EXPECT_NEAR(stage.depth_scale, stage.depth_of_field_mm / reach, 1e-3 * stage.depth_scale);
}

TEST(StageWithACamera, IgnoresGeometryOutsideItsView) {
  SceneDescription scene = ball_scene();
  scene.cameras = {camera({0, 0, 10}, {0, 0, 0}, {0, 1, 0}, 40)};
  const double alone = make_stage(scene, model()).depth_scale;
  Sphere beside;
  beside.centre = {500, 0, -15};
  scene.spheres.push_back(beside);
  scene.meshes = {quad({-1, 50, 9}, {1, 50, 9}, {1, 50, -15}, {-1, 50, -15})};
  EXPECT_EQ(make_stage(scene, model()).depth_scale, alone);
}

TEST(StageWithACamera, TheWallBehindItIsNotShown) {
  SceneDescription scene = ball_scene();
  scene.cameras = {camera({0, 0, 10}, {0, 0, 0}, {0, 1, 0}, 40)};
  scene.cameras[0].hither = 1.0;
  scene.meshes = {card(30)};
  const Stage stage = make_stage(scene, model());
  EXPECT_NEAR(stage.near_mm, 9.0 * stage.mm_per_unit * stage.depth_scale, 1e-9);
}

TEST(StageOptions, OverrideAutomaticChoices) {
  SceneDescription scene = ball_scene();
  scene.cameras = {camera({0, 0, 10}, {0, 0, 0}, {0, 1, 0}, 40)};
  const Stage stage = make_stage(
      scene, model(), {.centre = Vec3{1, 2, 3}, .mm_per_unit = 25.0, .depth_scale = 0.5});
  expect_near(stage.panel_from_world.point({1, 2, 3}), {0, 0, 0});
  expect_near(stage.panel_from_world.point({2, 2, 4}), {25, 0, 12.5});
}

TEST(StageOptions, ARotationBringsTheSidesToTheFront) {
  // A quarter turn about the vertical: seen from above the scene turns anticlockwise.
  const Stage stage = make_stage(ball_scene(), model(),
                                 {.depth_scale = 1.0, .turn_degrees = 90, .pitch_degrees = 0.0});
  const double s = stage.mm_per_unit;
  expect_near(stage.panel_from_world.point({1, 0, 0}), {0, 0, -s});
  expect_near(stage.panel_from_world.point({0, 0, 1}), {s, 0, 0});
}

TEST(StageOptions, ASceneThatTurnsBeforeItsCameraIsNotCut) {
  SceneDescription scene = ball_scene();
  scene.cameras = {camera({0, 0, 10}, {0, 0, 0}, {0, 1, 0}, 40)};
  for (const double turn : {0.0, 90.0, 180.0}) {
    const Stage stage = make_stage(scene, model(), {.depth_scale = 0.5, .turn_degrees = turn});
    EXPECT_GE(stage.near_mm, 0.5 * stage.mm_per_unit * (1 - 1e-12)) << turn;
  }
  const Stage above = make_stage(scene, model(), {.depth_scale = 0.5, .pitch_degrees = 90.0});
  EXPECT_GE(above.near_mm, 0.5 * above.mm_per_unit * (1 - 1e-12));
}

TEST(StageOptions, ThePitchAddsToTheCameras) {
  SceneDescription scene = ball_scene();
  scene.cameras = {camera({0, 0, 10}, {0, 0, 0}, {0, 1, 0}, 40)};
  const StageOptions above{.depth_scale = 1.0, .pitch_degrees = 90.0};
  const Stage stage = make_stage(scene, model(), above);
  const double s = stage.mm_per_unit;
  expect_near(stage.panel_from_world.point({0, 1, 0}), {0, 0, s});
  expect_near(stage.panel_from_world.point({0, 0, 1}), {0, -s, 0});
}

TEST(StageOptions, IgnoredCamerasDoNotPlaceTheScene) {
  SceneDescription scene = ball_scene();
  const Stage without = make_stage(scene, model());
  scene.cameras = {camera({10, 0, 0}, {0, 0, 0}, {0, 0, 1}, 40)};
  const Stage ignored = make_stage(scene, model(), {.ignore_cameras = true});
  EXPECT_EQ(ignored.mm_per_unit, without.mm_per_unit);
  EXPECT_EQ(ignored.near_mm, without.near_mm);
  for (const Vec3 p : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}})
    EXPECT_EQ(ignored.panel_from_world.point(p), without.panel_from_world.point(p));
}

TEST(StageOptions, InvalidValuesAreUsageErrors) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const StageOptions& options :
       {StageOptions{.centre = Vec3{nan, 0, 0}}, StageOptions{.mm_per_unit = 0.0},
        StageOptions{.mm_per_unit = -1.0}, StageOptions{.depth_scale = 0.0},
        StageOptions{.depth_scale = nan}, StageOptions{.depth_budget = 0.0},
        StageOptions{.fill = 0.0}, StageOptions{.fill = 1.5}, StageOptions{.turn_degrees = nan},
        StageOptions{.pitch_degrees = 91.0}, StageOptions{.pitch_degrees = nan}})
    EXPECT_EQ(error_of([&] { (void)make_stage(ball_scene(), model(), options); }).kind(),
              ErrorKind::Usage);
}

TEST(Stage, AScaledDepthShowsTheUndistortedSceneFromFartherAway) {
  const auto seen_from = [](double distance_mm, Vec3 panel_mm) {
    const double onto_panel = distance_mm / (distance_mm - panel_mm.z);
    return Vec3{panel_mm.x * onto_panel, panel_mm.y * onto_panel, 0.0};
  };
  const Stage whole = make_stage(ball_scene(), model(), {.depth_scale = 1.0});
  for (const double scale : {0.9, 0.3, 0.05}) {
    const Stage scaled =
        make_stage(ball_scene(), model(),
                   {.centre = Vec3{}, .mm_per_unit = whole.mm_per_unit, .depth_scale = scale});
    for (const Vec3 p : {Vec3{0.3, -0.7, 0.6}, Vec3{-0.9, 0.1, -0.4}, Vec3{0.2, 0.2, 1.0}})
      expect_near(seen_from(700.0, scaled.panel_from_world.point(p)),
                  seen_from(700.0 / scale, whole.panel_from_world.point(p)));
  }
}

TEST(Stage, WorldDirectionsDoNotDependOnTheDepthScale) {
  const auto direction = [](double depth_scale) {
    return world_direction(make_stage(ball_scene(), model(), {.depth_scale = depth_scale}),
                           {0.4, -0.6, -1.0});
  };
  expect_near(direction(0.01), direction(1.0), 1e-12);
  EXPECT_NEAR(length(direction(0.5)), 1.0, 1e-12);
}

TEST(Stage, AnEmptySceneIsAnInputError) {
  SceneDescription nothing;
  nothing.source = "void.nff";
  const Error error = error_of([&] { (void)make_stage(nothing, model()); });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  EXPECT_STREQ(error.what(), "void.nff: nothing to see in this scene: it has no surface");
  nothing.notes = {"points and lines left out"};
  EXPECT_STREQ(error_of([&] { (void)make_stage(nothing, model()); }).what(),
               "void.nff: nothing to see in this scene: points and lines left out");
}

// ---- content that no ray meets

bool meets(const SceneDescription& scene, const StageOptions& options, double distance_mm = 700.0) {
  const optics::OpticalModel rig = model(2.0, distance_mm);
  return content_in_view(scene, make_stage(scene, rig, options), rig) != InView::Nothing;
}

TEST(ContentMeetsRays, WhereItIsFitted) {
  EXPECT_TRUE(meets(ball_scene(), {}));
  SceneDescription cards;
  cards.meshes = {card(0.5)};
  EXPECT_TRUE(meets(cards, {}));
  Cone cone;
  cone.apex = {0, 0, 5};
  SceneDescription cones;
  cones.cones = {cone};
  EXPECT_TRUE(meets(cones, {}));
  EXPECT_TRUE(meets(cones, {}, std::numeric_limits<double>::infinity()));
}

TEST(ContentMeetsRays, NotBesideThePanel) {
  const StageOptions beside{.centre = Vec3{100, 0, 0}, .mm_per_unit = 100.0, .depth_scale = 0.1};
  EXPECT_FALSE(meets(ball_scene(), beside));
  const StageOptions below{.centre = Vec3{0, 100, 0}, .mm_per_unit = 100.0, .depth_scale = 0.1};
  EXPECT_FALSE(meets(ball_scene(), below));
  EXPECT_FALSE(meets(ball_scene(), beside, std::numeric_limits<double>::infinity()));
}

TEST(ContentMeetsRays, BesideThePanelIfItIsFarBehindIt) {
  // At a third of a metre behind the panel, oblique rays reach beyond the panel's edge.
  const StageOptions options{
      .centre = Vec3{-3.5, 0, 3.3}, .mm_per_unit = 100.0, .depth_scale = 1.0, .pitch_degrees = 0.0};
  EXPECT_TRUE(meets(ball_scene({}, 0.1), options));
}

TEST(ContentMeetsRays, NotBehindTheCamera) {
  SceneDescription scene = ball_scene();
  scene.cameras = {camera({0, 0, 10}, {0, 0, 20}, {0, 1, 0}, 40)};
  EXPECT_FALSE(meets(scene, {}));
  scene.cameras = {camera({0, 0, 10}, {0, 0, 5}, {0, 1, 0}, 40)};
  EXPECT_TRUE(meets(scene, {}));
  EXPECT_TRUE(meets(ball_scene({0, 0, 30}), {.ignore_cameras = true}));
}

/// Returns a square that fills the view, with a metallic-roughness material.
SceneDescription plate(bool faces_viewer, bool double_sided) {
  SceneDescription scene;
  PbrMaterial material;
  material.double_sided = double_sided;
  scene.materials = {{.pbr = std::make_shared<const PbrMaterial>(material)}};
  scene.meshes = {card(0)};
  if (!faces_viewer)
    for (auto& triangle : scene.meshes[0].triangles) std::swap(triangle[0], triangle[1]);
  return scene;
}

InView in_view(const SceneDescription& scene, double distance_mm = 700.0) {
  const optics::OpticalModel rig = model(2.0, distance_mm);
  return content_in_view(scene, make_stage(scene, rig, {}), rig);
}

TEST(ContentInView, TellsBackFacesFromSurfacesThatAreSeen) {
  for (const double distance : {700.0, std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(in_view(plate(true, false), distance), InView::Content);
    EXPECT_EQ(in_view(plate(false, true), distance), InView::Content);
    EXPECT_EQ(in_view(plate(false, false), distance), InView::BackFaces);
    SceneDescription shown = plate(false, false);
    show_both_sides(shown);
    EXPECT_EQ(in_view(shown, distance), InView::Content);
    SceneDescription beside_a_ball = plate(false, false);
    beside_a_ball.spheres = {{}};
    EXPECT_EQ(in_view(beside_a_ball, distance), InView::Content);
  }
}

TEST(ContentInView, FromInsideASingleSidedBoxIsOfBackFaces) {
  SceneDescription scene = plate(true, false);
  scene.meshes = {card(0.5)};  // faces +z, outward
  TriangleMesh& back = scene.meshes.emplace_back(card(-0.5));
  for (auto& triangle : back.triangles) std::swap(triangle[0], triangle[1]);
  scene.cameras = {camera({0, 0, 0.1}, {0, 0, -0.2}, {0, 1, 0}, 60)};
  EXPECT_EQ(in_view(scene), InView::BackFaces);
  scene.cameras = {camera({0, 0, 2}, {0, 0, 0}, {0, 1, 0}, 60)};
  EXPECT_EQ(in_view(scene), InView::Content);
}

TEST(GroundUnder, LiesAtTheLowestPointAndHasTheMeanSizeOfTheModel) {
  const auto ground = [](Vec3 low, Vec3 high) { return ground_under({low, high}); };
  const Ground box = ground({1, -2, 3}, {3, 6, 7});
  EXPECT_EQ(box.y, -2.0);
  EXPECT_NEAR(box.size, 4.0, 1e-12);
  EXPECT_EQ(ground({0, 0, 0}, {8, 0, 4}).size, 2.0);     // flat
  EXPECT_EQ(ground({0, 0, 0}, {1, 1000, 1}).size, 2.0);  // a pole
  EXPECT_EQ(ground({0, 0, 0}, {0, 5, 0}).size, 0.0);
}

}  // namespace
}  // namespace lenticule::render
