// SPDX-License-Identifier: Apache-2.0
// Tests area lights, occlusion and environment light against the reference and closed forms, and
// the convergence of their errors.
#include "render/options/soft_light.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>
#include <numbers>

#include "base/error.h"
#include "frames/srgb.h"
#include "render/accel/denormals.h"
#include "render/integrator/packet_tracer.h"
#include "render/make_method.h"
#include "render/rays/primary_packets.h"
#include "render/scene/scene.h"
#include "render/scene/surroundings.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/reference_renderer.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using testing::make_rig;
using testing::make_tiny_stage;

struct Picture {
  frames::WovenFrame frame;
  RenderStatistics statistics;
};

Picture picture(const SceneDescription& description, const optics::Rig& rig, const Stage& stage,
                const RenderOptions& options, const Surroundings& surroundings = {}) {
  const optics::OpticalModel model(rig);
  const Scene scene(description, stage, surroundings, options.threads);
  Picture made{frames::WovenFrame({rig.panel.width_px, rig.panel.height_px}), {}};
  made.statistics = make_method("full", model, options)->render(scene, stage, made.frame);
  return made;
}

RenderOptions with(const SoftLight& soft) {
  return {.threads = 1, .soft = soft, .cancelled = {}};
}

/// Returns all options, in two sets because occlusion and environment exclude each other.
std::vector<SoftLight> kinds() {
  return {{.shadow_samples = 5,
           .light_radius_mm = 13.0,
           .sun_radius_degrees = 4.0,
           .occlusion_samples = 7,
           .occlusion_distance_mm = 11.0},
          {.shadow_samples = 8,
           .light_radius_mm = 25.0,
           .sun_radius_degrees = 2.0,
           .environment_samples = 6}};
}

class SoftLightOfTinyScenes : public ::testing::TestWithParam<testing::NamedScene> {};

/// The same samples in double precision: in one of two thousand subpixels, a sample may differ
/// where a ray grazes an edge.
TEST_P(SoftLightOfTinyScenes, AgreesWithTheReference) {
  const optics::Rig rig = make_rig({.width = 40, .height = 26, .pixel_mm = 1.5});
  const optics::OpticalModel model(rig);
  const Stage stage = make_tiny_stage({.centre = {0.1, 0.0, -0.2}, .turn_degrees = 13.0});
  int subpixels = 0, different = 0;
  for (const SoftLight& soft : kinds()) {
    const frames::WovenFrame frame = picture(GetParam().scene, rig, stage, with(soft)).frame;
    const frames::WovenFrame hard = picture(GetParam().scene, rig, stage, with({})).frame;
    EXPECT_NE(frame, hard);
    for (int j = 0; j < frame.height(); ++j)
      for (int i = 0; i < frame.width(); ++i)
        for (int c = 0; c < 3; ++c) {
          const double expected =
              testing::reference_subpixel(GetParam().scene, stage, model, i, j, c, {.soft = soft});
          ++subpixels;
          if (std::abs(expected - frame.row(j)[3 * i + c]) > 1.0) ++different;
        }
  }
  RecordProperty("different", different);
  std::printf("%s: %d of %d differ\n", GetParam().name.c_str(), different, subpixels);
  EXPECT_LE(different, subpixels / 2000);
}

INSTANTIATE_TEST_SUITE_P(TinyScenes, SoftLightOfTinyScenes,
                         ::testing::ValuesIn(testing::tiny_scenes()),
                         [](const auto& scene) { return scene.param.name; });

/// Returns a matte white wall with a ball in front of it and an area light beside the eye: half of
/// the wall's light comes from the area light, the rest from the hemisphere.
SceneDescription wall_and_ball() {
  SceneDescription scene;
  scene.colour_managed = false;
  scene.ambient = Vec3{0.4, 0.4, 0.4};
  scene.background = {0.4, 0.4, 0.4};
  scene.materials = {Material{}};
  scene.meshes = {testing::rectangle_mesh({-40, -40, -1}, {80, 0, 0}, {0, 80, 0}, 0)};
  scene.spheres = {{.centre = {0.1, 0.2, 0.4}, .radius = 1.0}};
  Light area_light;
  area_light.position = {1.5, 2.5, 9.0};
  area_light.colour = {0.6, 0.6, 0.6};
  scene.lights = {area_light};
  return scene;
}

SoftLight only_shadows(int samples) {
  return {.shadow_samples = samples, .light_radius_mm = 25.0};
}
SoftLight only_occlusion(int samples) {
  return {.occlusion_samples = samples, .occlusion_distance_mm = 30.0};
}
SoftLight only_environment(int samples) {
  return {.environment_samples = samples};
}

/// Lights without a size cast hard shadows as before.
TEST_P(SoftLightOfTinyScenes, WithoutSizeOrSamplesHasTheBytesOfHardLight) {
  const optics::Rig rig = make_rig({.width = 100, .height = 60, .pixel_mm = 0.6});
  const frames::WovenFrame hard = picture(GetParam().scene, rig, make_tiny_stage(), {}).frame;
  for (const SoftLight& soft :
       {SoftLight{.shadow_samples = 16, .light_radius_mm = 0.0, .sun_radius_degrees = 0.0},
        SoftLight{.light_radius_mm = 50.0, .sun_radius_degrees = 9.0}})
    EXPECT_EQ(hard, picture(GetParam().scene, rig, make_tiny_stage(), with(soft)).frame);
}

TEST_P(SoftLightOfTinyScenes, HasTheSameBytesForAnyThreadsTilesAndInstructionSet) {
  const optics::Rig rig = make_rig({.width = 150, .height = 40, .pixel_mm = 0.6});
  for (const SoftLight& soft : kinds()) {
    RenderOptions options = with(soft);
    options.samples = 2;
    options.isa = Isa::Baseline;
    const frames::WovenFrame plain =
        picture(GetParam().scene, rig, make_tiny_stage(), options).frame;
    options.threads = 3;
    EXPECT_EQ(plain, picture(GetParam().scene, rig, make_tiny_stage(), options).frame);
    options.tiles_backwards = true;
    for (const Isa isa : test::every_instruction_set()) {
      options.isa = isa;
      EXPECT_EQ(plain, picture(GetParam().scene, rig, make_tiny_stage(), options).frame)
          << isa_name(isa);
    }
  }
}

/// Samples whose visibility is decided by culling are not traced, and nothing else changes.
TEST_P(SoftLightOfTinyScenes, HasTheSameBytesWithoutCulling) {
  const optics::Rig rig = make_rig({.width = 300, .height = 80, .pixel_mm = 0.25});
  for (const double size : {2.0, 15.0}) {
    RenderOptions options = with({.shadow_samples = 4,
                                  .light_radius_mm = size,
                                  .sun_radius_degrees = 0.2 * size,
                                  .occlusion_samples = 4,
                                  .occlusion_distance_mm = size});
    const Picture culled = picture(GetParam().scene, rig, make_tiny_stage(), options);
    options.use_shaft_culling = false;
    const Picture traced = picture(GetParam().scene, rig, make_tiny_stage(), options);
    EXPECT_EQ(culled.frame, traced.frame);
    const RenderStatistics& with_culling = culled.statistics;
    EXPECT_EQ(with_culling.shadow_rays, traced.statistics.shadow_rays);
    EXPECT_EQ(with_culling.ambient_rays, traced.statistics.ambient_rays);
    EXPECT_EQ(traced.statistics.shadow_rays_culled + traced.statistics.shadow_rays_blocked +
                  traced.statistics.ambient_rays_culled,
              0U);
    if (size < 10.0) {
      EXPECT_GT(with_culling.shadow_rays_culled, with_culling.shadow_rays / 30);
      EXPECT_GT(with_culling.ambient_rays_culled, with_culling.ambient_rays / 10);
    }
    const auto percent = [](uint64_t part, uint64_t all) {
      return 100.0 * static_cast<double>(part) / static_cast<double>(all);
    };
    std::printf("%s, %.0f mm: %.0f %% lit, %.0f %% blocked, %.0f %% with nothing around\n",
                GetParam().name.c_str(), size,
                percent(with_culling.shadow_rays_culled, with_culling.shadow_rays),
                percent(with_culling.shadow_rays_blocked, with_culling.shadow_rays),
                percent(with_culling.ambient_rays_culled, with_culling.ambient_rays));
  }
}

TEST_P(SoftLightOfTinyScenes, OcclusionOnlyReducesAmbientLight) {
  const optics::Rig rig = make_rig({.width = 100, .height = 60, .pixel_mm = 0.6});
  SceneDescription dark = GetParam().scene;
  dark.ambient = Vec3{};
  const auto codes = [&](const SceneDescription& scene, const SoftLight& soft) {
    return picture(scene, rig, make_tiny_stage(), with(soft)).frame;
  };
  const frames::WovenFrame most = codes(GetParam().scene, {});
  const frames::WovenFrame least = codes(dark, {});
  const frames::WovenFrame some = codes(GetParam().scene, only_occlusion(8));
  int between = 0;
  for (size_t k = 0; k < some.bytes().size(); ++k) {
    ASSERT_LE(some.bytes()[k], most.bytes()[k]);
    ASSERT_GE(some.bytes()[k], least.bytes()[k]);
    between += some.bytes()[k] != most.bytes()[k] && some.bytes()[k] != least.bytes()[k] ? 1 : 0;
  }
  EXPECT_GT(between, 100);
}

/// Matte surfaces reflect no more than with all lights straight above them, and no less than
/// without lights.
TEST(SoftShadows, StayBetweenNoLightAndFullLight) {
  const optics::Rig rig = make_rig({.width = 60, .height = 40, .pixel_mm = 1.0});
  const auto codes = [&](const SceneDescription& scene, const SoftLight& soft) {
    return picture(scene, rig, make_tiny_stage(), with(soft)).frame;
  };
  SceneDescription unlit = wall_and_ball();
  unlit.lights.clear();
  const frames::WovenFrame least = codes(unlit, {});
  for (const double radius : {1.0, 30.0, 500.0}) {
    const frames::WovenFrame some =
        codes(wall_and_ball(), {.shadow_samples = 8, .light_radius_mm = radius});
    for (size_t k = 0; k < some.bytes().size(); ++k) ASSERT_GE(some.bytes()[k], least.bytes()[k]);
  }
  SceneDescription halved = wall_and_ball();
  for (Light& area_light : halved.lights) area_light.colour = area_light.colour * 0.5;
  const frames::WovenFrame dim = codes(halved, only_shadows(8));
  for (const uint8_t code : dim.bytes()) ASSERT_LE(code, 179);
}

/// Nothing occludes: all samples agree.
TEST(Occlusion, IsZeroForAnOpenSurface) {
  SceneDescription scene = wall_and_ball();
  scene.spheres.clear();
  const optics::Rig rig = make_rig({});
  EXPECT_EQ(picture(scene, rig, make_tiny_stage(), with(only_occlusion(7))).frame,
            picture(scene, rig, make_tiny_stage(), with({})).frame);
}

/// Inside a closed box every ray to the hemisphere ends at a wall.
TEST(Occlusion, IsCompleteInAClosedRoom) {
  SceneDescription scene = wall_and_ball();
  scene.lights.clear();
  scene.meshes = {testing::box_mesh({-9, -8, -4}, {9, 8, 9}, 0)};
  Stage inside = make_tiny_stage();
  inside.near_mm = 20.0;
  const double inf = std::numeric_limits<double>::infinity();
  const SoftLight far{.occlusion_samples = 5, .occlusion_distance_mm = inf};
  const auto expect_all = [&](const SoftLight& soft, int expected) {
    const frames::WovenFrame frame = picture(scene, make_rig({}), inside, with(soft)).frame;
    for (const uint8_t code : frame.bytes()) ASSERT_EQ(code, expected);
  };
  expect_all(far, 0);
  expect_all(only_environment(5), 0);
  expect_all({}, 102);
}

/// No point of the light is visible from the wall behind a wide screen.
TEST(SoftShadows, AreCompleteBehindAScreen) {
  SceneDescription scene = wall_and_ball();
  scene.spheres.clear();
  scene.lights.front().position = {0.0, 0.0, -9.0};  // wholly behind the wall
  const optics::Rig rig = make_rig({});
  SceneDescription unlit = scene;
  unlit.lights.clear();
  EXPECT_EQ(picture(scene, rig, make_tiny_stage(), with(only_shadows(9))).frame,
            picture(unlit, rig, make_tiny_stage(), with({})).frame);
}

/// A white surface in an environment of uniform brightness has the environment's brightness and a
/// grey one half of it, with smooth normals or without.
TEST(EnvironmentLight, OfUniformBrightnessIsReflectedByEverySurface) {
  SceneDescription scene;
  scene.colour_managed = false;
  scene.background = {0.8, 0.8, 0.8};
  scene.ambient = Vec3{0.1, 0.1, 0.1};
  scene.materials = {Material{}, Material{.colour = {0.5, 0.5, 0.5}}};
  scene.spheres = {{.centre = {-2.5, 0, 0}, .radius = 1.2, .material = 1}};
  scene.meshes = {testing::ball_mesh({2.5, 0, 0}, 1.2, 5, 1),
                  testing::ball_mesh({0, 0, 0}, 1, 4, 0)};
  // One object at a time, since several would reflect each other.
  const optics::Rig rig = make_rig({});
  int half = 0;
  for (int only = 0; only < 3; ++only) {
    SceneDescription alone = scene;
    if (only != 0) alone.spheres.clear();
    alone.meshes.clear();
    if (only != 0) alone.meshes = {scene.meshes[static_cast<size_t>(only - 1)]};
    const Picture made = picture(alone, rig, make_tiny_stage(), with(only_environment(6)));
    EXPECT_GT(made.statistics.ambient_rays, 100U);
    for (const uint8_t code : made.frame.bytes()) {
      ASSERT_TRUE(code == 204 || (code == 102 && only != 2)) << int{code} << " of " << only;
      half += code == 102 ? 1 : 0;
    }
  }
  EXPECT_GT(half, 20);
}

/// An unoccluded wall under a sky: the sum over all directions, by quadrature.
TEST(EnvironmentLight, OfASkyEqualsItsIntegral) {
  SceneDescription scene = wall_and_ball();
  scene.colour_managed = true;
  scene.spheres.clear();
  scene.lights.clear();
  const optics::Rig rig = make_rig({});
  Surroundings surroundings;
  surroundings.sky = true;
  const frames::WovenFrame frame =
      picture(scene, rig, make_tiny_stage(), with(only_environment(1024)), surroundings).frame;
  const Scene committed(scene, make_tiny_stage(), surroundings, 1);
  constexpr int kSteps = 400;
  for (int c = 0; c < 3; ++c) {
    double sum = 0.0;
    for (int a = 0; a < kSteps; ++a)
      for (int b = 0; b < kSteps; ++b) {
        const double radius = std::sqrt((a + 0.5) / kSteps);
        const double angle = 2.0 * std::numbers::pi * (b + 0.5) / kSteps;
        sum += backdrop_light(
            committed.backdrop,
            {radius * std::cos(angle), radius * std::sin(angle), std::sqrt(1.0 - radius * radius)},
            c);
      }
    const double expected = 255.0 * frames::srgb_from_linear(sum / (kSteps * kSteps));
    for (int i = 0; i < frame.width(); ++i) ASSERT_NEAR(frame.row(3)[3 * i + c], expected, 1.2);
  }
}

struct Converging {
  const char* name;
  std::function<SoftLight(int)> options;
};

class SoftLightConverges : public ::testing::TestWithParam<Converging> {
 protected:
  [[nodiscard]] frames::WovenFrame codes(int samples) const {
    return picture(wall_and_ball(), rig_, stage_, with(GetParam().options(samples))).frame;
  }

  struct Place {
    int i, j, channel;
    double expected;
  };
  /// Returns some places where a few samples disagree, with the values of thousands of samples.
  [[nodiscard]] std::vector<Place> uncertain_places() const {
    const optics::OpticalModel model(rig_);
    const frames::WovenFrame few = codes(4), more = codes(64);
    std::vector<Place> places;
    int uncertain = 0;
    for (int j = 0; j < few.height(); ++j)
      for (int i = 0; i < few.width(); ++i)
        for (int c = 0; c < 3; ++c) {
          if (few.row(j)[3 * i + c] == more.row(j)[3 * i + c]) continue;
          if (uncertain++ % 11 != 0) continue;
          places.push_back({i, j, c,
                            testing::reference_subpixel(wall_and_ball(), stage_, model, i, j, c,
                                                        {.soft = GetParam().options(4096)})});
        }
    return places;
  }

  const optics::Rig rig_ = make_rig({.width = 40, .height = 26, .pixel_mm = 1.5});
  const Stage stage_ = make_tiny_stage();
};

/// The convergence is at least that of independent samples: half the error for four times the rays.
TEST_P(SoftLightConverges, ToAReferenceWithThousandsOfSamples) {
  const std::vector<Place> places = uncertain_places();
  ASSERT_GT(places.size(), 150U);
  std::vector<double> errors;
  for (const int samples : {4, 16, 64, 256}) {
    const frames::WovenFrame frame = codes(samples);
    double sum = 0.0;
    for (const Place& at : places) {
      const double error = frame.row(at.j)[3 * at.i + at.channel] - at.expected;
      sum += error * error;
    }
    errors.push_back(std::sqrt(sum / static_cast<double>(places.size())));
    std::printf("%s: %zu places, %d samples: %.2f codes\n", GetParam().name, places.size(), samples,
                errors.back());
  }
  constexpr double kRounding = 0.3;  // rounding error in codes
  for (size_t k = 1; k < errors.size(); ++k) EXPECT_LE(errors[k], 0.5 * errors[k - 1] + kRounding);
  EXPECT_LE(errors[3], errors[0] / 8.0 + kRounding);
}

INSTANTIATE_TEST_SUITE_P(Kinds, SoftLightConverges,
                         ::testing::Values(Converging{"shadows", only_shadows},
                                           Converging{"occlusion", only_occlusion},
                                           Converging{"environment", only_environment}),
                         [](const auto& kind) { return std::string(kind.param.name); });

/// The errors of subpixels that an eye sees together are uncorrelated.
TEST_P(SoftLightConverges, WithUncorrelatedErrors) {
  const optics::Rig rig = make_rig({.width = 120, .height = 78, .pixel_mm = 0.5});
  const auto codes = [&](int samples) {
    return picture(wall_and_ball(), rig, stage_, with(GetParam().options(samples))).frame;
  };
  const frames::WovenFrame few = codes(4), many = codes(1024);
  const auto error = [&](int row, int subpixel) {
    return static_cast<double>(int{few.row(row)[subpixel]} - int{many.row(row)[subpixel]});
  };
  struct Step {
    const char* to;
    int rows, subpixels;
  };
  // The pitch is 7.7 subpixels, so that eight steps lead to about the same view of the next lens.
  for (const Step step : {Step{"the next view", 0, 1}, Step{"the next of its channel", 0, 3},
                          Step{"the next lens", 0, 8}, Step{"the next row", 1, 0},
                          Step{"the same view below", 1, -1}}) {
    double product = 0.0, squares = 0.0;
    int pairs = 0;
    for (int j = 0; j + step.rows < few.height(); ++j)
      for (int s = 1; s + 8 < 3 * few.width(); ++s) {
        const double here = error(j, s), there = error(j + step.rows, s + step.subpixels);
        if (here == 0.0 || there == 0.0) continue;
        product += here * there;
        squares += 0.5 * (here * here + there * there);
        ++pairs;
      }
    ASSERT_GT(pairs, 800);
    std::printf("%s: %s: correlation %.3f of %d pairs\n", GetParam().name, step.to,
                product / squares, pairs);
    EXPECT_LT(std::abs(product / squares), 0.1) << step.to;
  }
}

/// Traces one tile of a wall and a ball as the methods do.
class SoftTile : public ::testing::Test {
 protected:
  SoftTile()
      : rig_(make_rig({.width = 150, .height = 70, .pixel_mm = 0.5})),
        model_(rig_),
        scene_(wall_and_ball(), make_tiny_stage(), {}, 1),
        plan_(rig_),
        tile_(plan_.tile(4)),  // the left tile of the middle row
        packets_(model_, plan_, best_isa()),
        maker_(packets_),
        centre_(model_, {}) {
    maker_.start(scene_, tile_, centre_);
  }

  std::vector<float> whole(PacketTracer& tracer) {
    std::vector<float> light(static_cast<size_t>(tile_.columns) * TilePlan::kRows, 0.0F);
    tracer.trace(scene_, plan_, tile_, {0, tile_.columns}, {}, maker_, light);
    return light;
  }

  const FlushDenormals flush_;
  optics::Rig rig_;
  optics::OpticalModel model_;
  Scene scene_;
  TilePlan plan_;
  Tile tile_;
  PrimaryPackets packets_;
  PrimaryPackets::Maker maker_;
  Footprint centre_;
};

TEST_F(SoftTile, MultipliedSamplesEqualMoreSamples) {
  for (const auto& kind : {only_shadows, only_occlusion, only_environment}) {
    PacketTracer many(with(kind(12))), few(with(kind(3)));
    const std::vector<float> expected = whole(many);
    EXPECT_NE(whole(few), expected);
    few.multiply_samples(4);
    EXPECT_EQ(whole(few), expected);
    few.multiply_samples(1);
    EXPECT_NE(whole(few), expected);
  }
}

/// Lanes keep their own seeds in any packet.
TEST_F(SoftTile, PacketsOfSeveralColumnsGiveTheSameLanes) {
  SoftLight soft = only_occlusion(5);
  soft.shadow_samples = 6;
  PacketTracer tracer(with(soft));
  const std::vector<float> expected = whole(tracer);
  std::vector<RayPacket> columns(16);
  init_packets(columns);
  maker_.prepare(columns);
  // A column in the middle of the panel.
  const int first = 225 - plan_.subpixel(tile_, 0, 0);
  ASSERT_TRUE(first >= 0 && first + 16 <= tile_.columns);
  maker_.columns(first, columns);
  RayPacket mixed = columns.front();
  std::array<int32_t, kPacket> channel;
  std::array<uint32_t, kPacket> seeds;
  for (size_t r = 0; r < kPacket; ++r) {
    const RTCRay16& from = columns[r].rays.ray;
    mixed.valid[r] = columns[r].valid[r];
    mixed.rays.ray.org_x[r] = from.org_x[r];
    mixed.rays.ray.org_y[r] = from.org_y[r];
    mixed.rays.ray.org_z[r] = from.org_z[r];
    mixed.rays.ray.dir_x[r] = from.dir_x[r];
    mixed.rays.ray.dir_y[r] = from.dir_y[r];
    mixed.rays.ray.dir_z[r] = from.dir_z[r];
    const int row = static_cast<int>(r);
    const int subpixel = plan_.subpixel(tile_, first + row, row);
    channel[r] = (subpixel % 3 + 3) % 3;
    seeds[r] = sampling::subpixel_seed(tile_.row_begin + row, subpixel, 0);
  }
  std::array<float, kPacket> light;
  tracer.set_seeds(seeds);
  tracer.trace_lanes(scene_, plan_, channel, mixed, light);
  int lit = 0;
  for (size_t r = 0; r < kPacket; ++r) {
    EXPECT_EQ(light[r],
              expected[r * static_cast<size_t>(tile_.columns) + static_cast<size_t>(first) + r])
        << r;
    lit += light[r] > 0.0F ? 1 : 0;
  }
  EXPECT_GT(lit, 10);
}

/// Points traced by methods that reuse points have the bytes of `full`.
TEST(SoftLight, WorksInMethodsThatReusePoints) {
  const optics::Rig rig = make_rig({.width = 120, .height = 50, .pixel_mm = 0.5});
  const optics::OpticalModel model(rig);
  const Stage stage = make_tiny_stage();
  const SoftLight soft = only_shadows(8);
  const Scene scene(wall_and_ball(), stage, {}, 2);
  const Picture full = picture(wall_and_ball(), rig, stage, with(soft));
  for (const char* name : {"lens-view", "temporal"}) {
    RenderOptions options = with(soft);
    options.keep_missing = true;
    frames::WovenFrame one({120, 50}), two({120, 50});
    const auto method = make_method(name, model, options);
    const RenderStatistics statistics = method->render(scene, stage, one);
    options.threads = 2;
    (void)make_method(name, model, options)->render(scene, stage, two);
    EXPECT_EQ(one, two) << name;
    size_t equal = 0;
    for (size_t k = 0; k < one.bytes().size(); ++k)
      equal += one.bytes()[k] == full.frame.bytes()[k] ? 1 : 0;
    EXPECT_GE(equal, statistics.traced_subpixels) << name;
  }
}

TEST(SoftLight, RefusesInvalidOptions) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  for (const SoftLight& bad :
       {SoftLight{.shadow_samples = -1}, SoftLight{.shadow_samples = 1'000'000},
        SoftLight{.occlusion_samples = -1}, SoftLight{.environment_samples = 5000},
        SoftLight{.light_radius_mm = -1.0}, SoftLight{.light_radius_mm = nan},
        SoftLight{.light_radius_mm = inf}, SoftLight{.sun_radius_degrees = 90.0},
        SoftLight{.sun_radius_degrees = nan}, SoftLight{.occlusion_distance_mm = 0.0},
        SoftLight{.occlusion_distance_mm = nan},
        SoftLight{.occlusion_samples = 1, .environment_samples = 1}}) {
    const optics::OpticalModel model(make_rig({}));
    try {
      (void)make_method("full", model, with(bad));
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Usage);
    }
  }
  EXPECT_NO_THROW(validate({.occlusion_samples = 1, .occlusion_distance_mm = inf}));
}

}  // namespace
}  // namespace lenticule::render
