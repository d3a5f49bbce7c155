// SPDX-License-Identifier: Apache-2.0
// Tests the parts of `lenticule bench models`: the plain camera, the studio, jobs and pictures.
#include "apps/lenticule-bench/models/bench_models.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "frames/image_io.h"
#include "lab/judges/judge.h"
#include "optics/model.h"
#include "render/methods/method.h"
#include "render/scene/scene.h"
#include "render/scene/surroundings.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::bench {
namespace {

using lab::kModelFovDegrees;

using test::error_of;

const double kTangent = std::tan(kModelFovDegrees / 2.0 * std::numbers::pi / 180.0);

/// A place in a picture, as fractions of half its side: x to the right, y up.
struct Place {
  double x;
  double y;
};

/// Returns where a perspective projection puts a point.
Place projected(const render::Camera& camera, Vec3 point) {
  const Vec3 toward = normalized(camera.from - camera.at);
  const Vec3 right = normalized(cross(camera.up, toward));
  const Vec3 up = cross(toward, right);
  const Vec3 p = point - camera.from;
  const double depth = -dot(p, toward) * kTangent;
  return {dot(p, right) / depth, dot(p, up) / depth};
}

/// Returns a scene with one box.
render::SceneDescription box(Vec3 low, Vec3 high) {
  render::SceneDescription scene;
  scene.materials = {{}};
  scene.meshes = {test::box_mesh(low, high, 0)};
  return scene;
}

TEST(FramingCamera, ShowsTheMeshesAsLargeAsPossibleWithAMargin) {
  for (const Vec3 size : {Vec3{1, 1, 1}, Vec3{10, 1, 1}, Vec3{0.01, 3, 0.01}, Vec3{1, 1, 200}}) {
    const Vec3 low{7, -2, 3};
    const render::SceneDescription scene = box(low, low + size);
    const render::Camera camera = lab::framing_camera(scene);
    double largest = 0.0;
    for (const Vec3 corner : scene.meshes[0].positions) {
      const Place place = projected(camera, corner);
      largest = std::max({largest, std::abs(place.x), std::abs(place.y)});
    }
    EXPECT_NEAR(largest, 0.92, 1e-9);
  }
  EXPECT_EQ(error_of([] { (void)lab::framing_camera({}); }).kind(), ErrorKind::Input);
  EXPECT_EQ(error_of([] {
              (void)lab::framing_camera(box({1, 1, 1}, {1, 1, 1}));
            }).kind(),
            ErrorKind::Input);
}

/// Returns a description with one small ball that emits white.
render::SceneDescription ball_at(Vec3 centre, const render::Camera& camera) {
  render::SceneDescription scene;
  scene.source = "ball";
  scene.ambient = Vec3{};
  scene.materials = {{.diffuse = 0.0, .emission = {1, 1, 1}}};
  scene.spheres = {{.centre = centre, .radius = 0.06}};
  scene.cameras = {camera};
  return scene;
}

TEST(PlainCamera, ShowsPointsWhereAPerspectiveProjectionPutsThem) {
  constexpr int kSide = 96;
  const optics::Rig rig = lab::plain_camera_rig(kSide, kModelFovDegrees);
  const optics::OpticalModel model(rig);
  const render::Camera camera = lab::framing_camera(box({4, 0, -1}, {6, 2, 1}));
  for (const Vec3 centre : {Vec3{4, 0, -1}, Vec3{6, 2, -1}, Vec3{5, 1, 1}, Vec3{4, 2, 1}}) {
    const render::SceneDescription description = ball_at(centre, camera);
    const render::Stage stage =
        render::make_stage(description, model, lab::plain_camera_stage(camera, rig));
    const render::Scene scene(description, stage, {});
    frames::WovenFrame frame({.width = kSide, .height = kSide});
    render::make_method("full", model, {})->render(scene, stage, frame);
    for (int c = 0; c < 3; ++c) {
      double sum = 0.0, x = 0.0, y = 0.0;
      for (int j = 0; j < kSide; ++j)
        for (int i = 0; i < kSide; ++i) {
          const double light = frame.row(j)[3 * i + c];
          sum += light;
          x += light * (2.0 * (i + 0.5) / kSide - 1.0);
          y += light * (1.0 - 2.0 * (j + 0.5) / kSide);
        }
      ASSERT_GT(sum, 0.0);
      const Place place = projected(camera, centre);
      constexpr double kHalfAPixel = 1.0 / kSide;
      EXPECT_NEAR(x / sum, place.x, kHalfAPixel) << c;
      EXPECT_NEAR(y / sum, place.y, kHalfAPixel) << c;
    }
  }
}

TEST(Studio, IsWrittenAsTheRenderersFormulaSays) {
  const test::ScratchFolder folder;
  const auto file = folder.path() / "studio.hdr";
  constexpr int kWidth = 64;
  lab::write_studio(file, kWidth, kWidth / 2);
  const frames::FloatImage image = frames::floats_of(frames::read_texture(file));
  ASSERT_EQ(image.width, kWidth);
  ASSERT_EQ(image.height, kWidth / 2);
  const auto light = [&](int i, int j) {
    const size_t n = 4 * (static_cast<size_t>(j) * kWidth + static_cast<size_t>(i));
    return Vec3{image.rgba[n], image.rgba[n + 1], image.rgba[n + 2]};
  };
  const auto expect = [&](int i, int j, Vec3 from) {
    const Vec3 expected = Vec3{1, 1, 1} * render::studio_light(normalized(from));
    EXPECT_NEAR(length(light(i, j) - expected), 0.0, length(expected) / 64) << i << ", " << j;
  };
  const double step = std::numbers::pi / (kWidth / 2);
  const double low = std::tan(0.5 * step);  // the first row below the horizon
  expect(kWidth / 2, kWidth / 4, {low, -low, -1});
  expect(3 * kWidth / 4, kWidth / 4, {1, -low, low});
  expect(0, kWidth / 4, {-low, -low, 1});
}

TEST(Averaged, MixesLightAndNotCodes) {
  frames::WovenFrame checks({.width = 5, .height = 4});
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 5; ++i)
      for (int c = 0; c < 3; ++c) checks.row(j)[3 * i + c] = (i + j) % 2 == 0 ? 255 : 0;
  const frames::WovenFrame grey = averaged(checks.view(), 2);
  EXPECT_EQ(grey.width(), 2);
  EXPECT_EQ(grey.height(), 2);
  for (const uint8_t code : grey.bytes()) EXPECT_EQ(code, 188) << "half of the light";
  EXPECT_EQ(averaged(checks.view(), 1), checks);
  EXPECT_EQ(error_of([&] { (void)averaged(checks.view(), 5); }).kind(), ErrorKind::Usage);
}

}  // namespace
}  // namespace lenticule::bench
