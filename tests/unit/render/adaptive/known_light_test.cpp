// SPDX-License-Identifier: Apache-2.0
// Tests the notes that a traced packet records about its light, and the rays that the notes save.
#include <gtest/gtest.h>

#include <random>

#include "render/integrator/light_cache.h"
#include "render/methods/adaptive/retrace.h"
#include "render/shading/shading_tables.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

std::string name_of(const ::testing::TestParamInfo<test::NamedScene>& named) {
  std::string name = named.param.name;
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return name;
}

class CachedLight : public ::testing::TestWithParam<test::NamedScene> {
 protected:
  explicit CachedLight(const SoftLight& soft = {})
      : scene_(GetParam().scene, test::make_tiny_stage(), {}, 1),
        rig_(test::make_rig({})),
        plan_(rig_),
        groups_(scene_),
        tracer_(RenderOptions{.soft = soft, .cancelled = {}}) {}

  /// Aims neighbouring rays toward the middle of the scene.
  void aim(std::mt19937_64& random) {
    std::uniform_real_distribution<double> any(-1.0, 1.0);
    const Vec3 from = normalized(Vec3{any(random), any(random), any(random)}) * 60.0;
    const Vec3 at = Vec3{any(random), any(random), any(random)} * 12.0;
    std::vector<PathRay> rays(kPacket);
    for (PathRay& ray : rays) {
      ray.origin = from;
      ray.direction = normalized(at + Vec3{any(random), any(random), any(random)} * 4.0 - from);
      ray.target = 0;
    }
    load_packet(rays, packet_);
    for (size_t r = 0; r < kPacket; ++r) channel_[r] = static_cast<int32_t>(random() % 3);
  }

  Scene scene_;
  optics::Rig rig_;
  TilePlan plan_;
  SurfaceGroups groups_;
  RecordingTracer tracer_;
  RayPacket packet_;
  alignas(64) std::array<int32_t, kPacket> channel_{};
  alignas(64) std::array<float, kPacket> light_{}, known_light_{};
};

TEST_P(CachedLight, RecordingNotesChangesNoByte) {
  std::mt19937_64 random(5);
  for (int round = 0; round < 100; ++round) {
    aim(random);
    RayPacket again = packet_;
    tracer_.trace_lanes(scene_, plan_, channel_, packet_, light_);
    tracer_.trace_recording(scene_, plan_, channel_, groups_, 0.0F, again, known_light_);
    ASSERT_EQ(light_, known_light_);
  }
}

/// Known lights save rays and leave the light as it is.
TEST_P(CachedLight, SavesRaysAndChangesNoLight) {
  std::mt19937_64 random(6);
  uint64_t saved = 0;
  for (int round = 0; round < 100; ++round) {
    aim(random);
    tracer_.trace_recording(scene_, plan_, channel_, groups_, 0.0F, packet_, light_);
    const LightRecord notes = tracer_.notes();
    render::CachedLight known{};
    tracer_.trace_known(scene_, plan_, channel_, known, packet_, known_light_);
    known.set_lights(notes.lit, notes.hidden);
    for (size_t r = 0; r < kPacket; ++r) {
      if (packet_.valid[r] == 0) continue;
      ASSERT_NEAR(light_[r], known_light_[r], 1e-5) << "nothing known, lane " << r;
      known.secondary_lanes |= 1U << r;
      known.secondary[r] = notes.secondary[r];
    }
    const uint64_t before = tracer_.counts().secondary_rays;
    tracer_.trace_known(scene_, plan_, channel_, known, packet_, known_light_);
    EXPECT_EQ(tracer_.counts().secondary_rays, before);
    for (size_t r = 0; r < kPacket; ++r) {
      if (packet_.valid[r] == 0) continue;
      ASSERT_NEAR(light_[r], known_light_[r], 1e-5) << "all known, lane " << r;
      saved += notes.lit[r] != 0 ? 1U : 0U;
    }
  }
  EXPECT_GT(saved, 100U);
}

/// The rays of one colour serve the others, for any weight of the colours.
TEST_P(CachedLight, ServesTheOtherColours) {
  std::mt19937_64 random(7);
  for (int round = 0; round < 100; ++round) {
    aim(random);
    channel_.fill(1);
    tracer_.trace_recording(scene_, plan_, channel_, groups_, 0.0F, packet_, light_);
    for (const int32_t colour : {0, 2}) {
      channel_.fill(colour);
      const render::CachedLight nothing{};
      RayPacket first = packet_, second = packet_;
      tracer_.trace_known(scene_, plan_, channel_, nothing, first, known_light_, true);
      const auto secondary = std::to_array(tracer_.notes().secondary);
      tracer_.trace_known(scene_, plan_, channel_, nothing, second, light_);
      ASSERT_EQ(light_, known_light_) << "colour " << colour;
      ASSERT_EQ(secondary, std::to_array(tracer_.notes().secondary));
    }
  }
}

/// The tolerance saves rays, and no lane exceeds it: these scenes are hardly brighter than white.
TEST_P(CachedLight, StaysWithinTheToleratedError) {
  std::mt19937_64 random(8);
  constexpr float kBrightest = 2.0F;
  uint64_t exact_rays = 0, rays = 0;
  const auto traced = [&] {
    return tracer_.counts().secondary_rays + tracer_.counts().shadow_rays;
  };
  for (const float tolerated : {0.004F, 0.05F, 0.5F})
    for (int round = 0; round < 100; ++round) {
      aim(random);
      RayPacket again = packet_;
      const uint64_t before = traced();
      tracer_.trace_lanes(scene_, plan_, channel_, packet_, light_);
      const uint64_t between = traced();
      tracer_.tolerate(tolerated);
      tracer_.trace_lanes(scene_, plan_, channel_, again, known_light_);
      tracer_.tolerate(0.0F);
      exact_rays += between - before;
      rays += traced() - between;
      for (size_t r = 0; r < kPacket; ++r) {
        if (packet_.valid[r] == 0) continue;
        ASSERT_NEAR(light_[r], known_light_[r], kBrightest * tolerated + 1e-5F) << "lane " << r;
      }
    }
  EXPECT_LT(rays, exact_rays);
  EXPECT_GT(tracer_.counts().rays_of_too_little, 0U);
}

/// Repeats the tests with sampled light.
class KnownSoftLight : public CachedLight {
 protected:
  static constexpr SoftLight kSoft{.shadow_samples = 16,
                                   .light_radius_mm = 8.0,
                                   .occlusion_samples = 16,
                                   .occlusion_distance_mm = 20.0};
  /// tolerance in codes; samples of an area light partly below the horizon are summed, not
  /// integrated
  static constexpr double kNear = 4.0 / 255.0;

  KnownSoftLight() : CachedLight(kSoft) {
    tracer_.integrate_area_lights(true);
    std::array<uint32_t, kPacket> seeds;
    for (size_t r = 0; r < kPacket; ++r)
      seeds[r] = sampling::subpixel_seed(3, static_cast<int>(r), 0);
    tracer_.set_seeds(seeds);
  }
  [[nodiscard]] uint64_t traced() const {
    const FrameCounts counts = tracer_.counts();
    return counts.shadow_rays - counts.shadow_rays_culled - counts.shadow_rays_blocked +
           counts.ambient_rays - counts.ambient_rays_culled;
  }
  void compare() {
    for (size_t r = 0; r < kPacket; ++r) {
      if (packet_.valid[r] == 0) continue;
      ++compared_;
      near_ += std::abs(light_[r] - known_light_[r]) < kNear ? 1 : 0;
    }
  }

  int compared_ = 0, near_ = 0;
};

TEST_P(KnownSoftLight, OtherColoursNeedNoRaysToAreaLightsAndEnvironment) {
  std::mt19937_64 random(9);
  for (int round = 0; round < 60; ++round) {
    aim(random);
    channel_.fill(1);
    tracer_.trace_recording(scene_, plan_, channel_, groups_, 0.0F, packet_, light_);
    channel_.fill(0);
    const render::CachedLight nothing{};
    RayPacket first = packet_, second = packet_;
    const uint64_t before = traced();
    tracer_.trace_known(scene_, plan_, channel_, nothing, first, known_light_, true);
    const uint64_t between = traced();
    tracer_.trace_known(scene_, plan_, channel_, nothing, second, light_);
    EXPECT_LE(10 * (between - before), traced() - between);
    compare();
  }
  EXPECT_GE(near_, 0.99 * compared_);
}

/// The notes about area lights and the hemisphere suffice to shade the first surface.
TEST_P(KnownSoftLight, SharesOfTheNotesReplaceRays) {
  std::mt19937_64 random(10);
  for (int round = 0; round < 60; ++round) {
    aim(random);
    tracer_.trace_recording(scene_, plan_, channel_, groups_, 0.0F, packet_, light_);
    const LightRecord& notes = tracer_.notes();
    render::CachedLight known{};
    for (size_t r = 0; r < kPacket; ++r) {
      known.secondary_lanes |= 1U << r;
      known.secondary[r] = notes.secondary[r];
      const auto set_known = [&](KnownShare& share, float value) {
        if (value == LightRecord::kNoShare) return;
        ASSERT_GE(value, 0.0F);
        ASSERT_LE(value, 1.0F);
        share.lanes |= 1U << r;
        share.share[r] = value;
      };
      set_known(known.around, notes.around[r]);
      for (size_t area_light = 0; area_light < scene_.shading->lights().size(); ++area_light)
        set_known(known.seen[area_light], notes.seen[area_light][r]);
    }
    RayPacket again = packet_;
    const uint64_t before = traced();
    tracer_.trace_known(scene_, plan_, channel_, known, again, known_light_);
    EXPECT_EQ(traced(), before);
    compare();
  }
  EXPECT_GE(near_, 0.99 * compared_);
}

/// Shares of integrals are closer to the ground truth than sums of as many samples.
TEST_P(KnownSoftLight, IntegralsAreAtLeastAsAccurateAsSums) {
  std::mt19937_64 random(11);
  double of_sums = 0.0, of_integrals = 0.0;
  alignas(64) std::array<float, kPacket> ground_truth{};
  const auto light = [&](bool integrate, int factor) {
    RayPacket packet = packet_;
    tracer_.integrate_area_lights(integrate);
    tracer_.multiply_samples(factor);
    tracer_.trace_lanes(scene_, plan_, channel_, packet, light_);
    return light_;
  };
  for (int round = 0; round < 60; ++round) {
    aim(random);
    ground_truth = light(false, 64);
    const auto sums = light(false, 1), integrals = light(true, 1);
    for (size_t r = 0; r < kPacket; ++r) {
      if (packet_.valid[r] == 0) continue;
      of_sums += std::pow(double{sums[r]} - double{ground_truth[r]}, 2.0);
      of_integrals += std::pow(double{integrals[r]} - double{ground_truth[r]}, 2.0);
    }
  }
  EXPECT_LE(of_integrals, 1.02 * of_sums);
}

INSTANTIATE_TEST_SUITE_P(Scenes, CachedLight, ::testing::ValuesIn(test::tiny_scenes()), name_of);
INSTANTIATE_TEST_SUITE_P(Scenes, KnownSoftLight, ::testing::ValuesIn(test::tiny_scenes()), name_of);

/// A ball over a floor: the notes distinguish the shadow from the lit floor, and the two surfaces.
TEST(Notes, DistinguishShadowsAndSurfaces) {
  SceneDescription description;
  description.materials = {Material{.name = "floor"}, Material{.name = "mirror", .specular = 0.5}};
  description.meshes = {test::rectangle_mesh({-5, 0, -5}, {0, 0, 10}, {10, 0, 0}, 0)};
  description.spheres = {Sphere{.centre = {0, 2, 0}, .radius = 0.5, .material = 1}};
  description.lights = {Light{.position = {0, 50, 0}}};
  const Stage stage = test::make_tiny_stage();
  const Scene scene(description, stage, {}, 1);
  const SurfaceGroups groups(scene);
  const optics::Rig rig = test::make_rig({});
  const TilePlan plan(rig);
  RecordingTracer tracer(RenderOptions{.cancelled = {}});
  std::vector<PathRay> rays(kPacket);
  const Affine& from_panel = scene.scene_from_panel;
  const auto aim = [&](size_t n, Vec3 world) {
    const Vec3 from = from_panel.point(stage.panel_from_world.point({4.0, 4.5, 4.0}));
    rays[n].origin = from;
    rays[n].direction = normalized(from_panel.point(stage.panel_from_world.point(world)) - from);
    rays[n].target = 0;
  };
  for (size_t n = 0; n < kPacket; ++n) aim(n, {3.0, 0.0, 3.0});  // lit floor
  aim(1, {3.5, 0.0, 3.0});                                       // lit floor, too
  aim(2, {0.0, 0.0, 0.0});                                       // shadow of the ball
  aim(3, {0.2, 2.0, 0.0});                                       // the ball
  RayPacket packet;
  load_packet(rays, packet);
  std::array<int32_t, kPacket> channel{};
  alignas(64) std::array<float, kPacket> light{};
  tracer.trace_recording(scene, plan, channel, groups, 0.0F, packet, light);
  const LightRecord& notes = tracer.notes();
  EXPECT_EQ(notes.way[0], notes.way[1]);
  EXPECT_NE(notes.way[0], notes.way[2]);
  EXPECT_NE(notes.way[0], notes.way[3]);
  EXPECT_EQ(notes.lit[0], 1U);
  EXPECT_EQ(notes.hidden[0], 0U);
  EXPECT_EQ(notes.lit[2], 0U);
  EXPECT_EQ(notes.hidden[2], 1U);
  EXPECT_EQ(notes.secondary[0], 0.0F);
}

}  // namespace
}  // namespace lenticule::render
