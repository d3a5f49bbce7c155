// SPDX-License-Identifier: Apache-2.0
// Tests sample points and the kernels' directions from them against the reference.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <numbers>
#include <random>

#include "render/accel/ray_stream.h"
#include "render/scene/texture.h"
#include "render/shading/shading_tables.h"
#include "render/shading/soft_shader.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/oracles/reference_sampling.h"

namespace lenticule::render {
namespace {

using shading_kernel::NewRays;
using shading_kernel::Surfaces;

TEST(SampleSet, SeedsAgreeWithTheReference) {
  for (const int row : {0, 1, 17, 2159})
    for (const int subpixel : {-3, 0, 5, 11519})
      for (const int sample : {0, 3})
        EXPECT_EQ(sampling::subpixel_seed(row, subpixel, sample),
                  test::reference_seed(row, subpixel, sample));
  uint32_t path = sampling::kFirstPath;
  for (const bool refracted : {false, true, true, false}) {
    const uint32_t longer = sampling::longer_path(
        path, refracted ? sampling::Turn::Refracted : sampling::Turn::Mirrored);
    EXPECT_EQ(longer, test::reference_path(path, refracted));
    path = longer;
  }
}

/// Tests sixteen lanes at surfaces of any orientation.
class SampleRays : public ::testing::TestWithParam<Isa> {
 protected:
  struct alignas(64) Made {
    NewRays rays;
    RayPacket packet;
  };

  SampleRays() : kernel_(shading_kernel_for(GetParam())) {
    for (size_t r = 0; r < kPacket; ++r) {
      seeds_[r] = sampling::subpixel_seed(static_cast<int>(r), 5, 0);
      weight_[r] = 1.0F;
    }
  }

  static Vec3 any_direction(std::mt19937_64& random) {
    std::normal_distribution<double> any;
    return normalized(Vec3{any(random), any(random), any(random)});
  }

  void face_anywhere(std::mt19937_64& random) {
    std::memset(static_cast<void*>(&surfaces_), 0, sizeof surfaces_);
    for (size_t r = 0; r < kPacket; ++r) {
      geometric_[r] = any_direction(random);
      smooth_[r] = normalized(geometric_[r] + any_direction(random) * 0.6);
      surfaces_.active[r] = -1;
      surfaces_.diffuse[r] = surfaces_.colour[r] = 1.0F;
      set(surfaces_.geometric, r, geometric_[r]);
      set(surfaces_.smooth, r, smooth_[r]);
    }
  }

  static void set(float (&lanes)[3][kPacket], size_t r, Vec3 v) {
    lanes[0][r] = static_cast<float>(v.x);
    lanes[1][r] = static_cast<float>(v.y);
    lanes[2][r] = static_cast<float>(v.z);
  }

  /// Places a sun in that direction, or an area light at that place.
  static void place(shading_kernel::Light& area_light, bool sun, Vec3 middle) {
    area_light.kind = sun ? shading_kernel::Light::kDirectional : shading_kernel::Light::kPoint;
    for (int k = 0; k < 3; ++k) {
      area_light.position[k] = static_cast<float>(component(middle, k));
      area_light.direction[k] = -area_light.position[k];
    }
  }

  static void clear(Made& made) {
    std::memset(static_cast<void*>(&made), 0, sizeof made);
    made.rays.packet = &made.packet.rays.ray.org_x[0];
    made.rays.valid = made.packet.valid;
  }
  static Vec3 direction(const Made& made, size_t r) {
    const RTCRay16& ray = made.packet.rays.ray;
    return {double{ray.dir_x[r]}, double{ray.dir_y[r]}, double{ray.dir_z[r]}};
  }

  [[nodiscard]] test::SquarePoint point(size_t r, uint32_t use, uint32_t index) const {
    return test::reference_point(seeds_[r], test::kReferencePath, use, index);
  }

  const shading_kernel::Kernel& kernel_;
  std::array<uint32_t, kPacket> seeds_{};
  Surfaces surfaces_{};
  std::array<Vec3, kPacket> geometric_, smooth_;
  alignas(64) float weight_[kPacket];
};

constexpr double kUnit = 2e-6;

TEST_P(SampleRays, ToTheHemisphereAgreeWithTheReference) {
  std::mt19937_64 random(3);
  const sampling::SampleSet set =
      sampling::sample_set(seeds_, sampling::kFirstPath, sampling::kUseAmbient);
  int below = 0;
  for (uint32_t i = 0; i < 500; ++i) {
    face_anywhere(random);
    Made made;
    clear(made);
    ASSERT_TRUE(kernel_.ambient_rays(7.0F, sampling::sample_of(set, i), surfaces_, made.rays));
    for (size_t r = 0; r < kPacket; ++r) {
      Vec3 expected = test::reference_cosine_direction(point(r, 0, i), smooth_[r]);
      const double height = dot(expected, geometric_[r]);
      if (height < 0.0) {
        ++below;
        expected = expected - geometric_[r] * (2.0 * height);
      }
      // Near the rim a rounding error of the radius grows to the root of one of the height.
      const double steep = std::max(1e-3, dot(expected, smooth_[r]));
      ASSERT_LT(length(direction(made, r) - expected), kUnit / steep) << i << " lane " << r;
      ASSERT_GT(dot(direction(made, r), geometric_[r]), -kUnit);
      ASSERT_EQ(made.packet.rays.ray.tfar[r], 7.0F);
    }
  }
  EXPECT_GT(below, 100);
}

TEST_P(SampleRays, ToAreaLightsAgreeWithTheReference) {
  std::mt19937_64 random(5);
  const sampling::SampleSet set =
      sampling::sample_set(seeds_, sampling::kFirstPath, sampling::use_of_light(2));
  shading_kernel::Light area_light{};
  area_light.colour[0] = 1.0F;
  int rays = 0;
  for (uint32_t i = 0; i < 500; ++i) {
    face_anywhere(random);
    const bool sun = i % 2 == 1;
    const Vec3 middle = any_direction(random) * (sun ? 1.0 : 90.0);
    const double radius = sun ? 0.3 : 25.0;
    place(area_light, sun, middle);
    Made made;
    clear(made);
    kernel_.area_light_rays(area_light, static_cast<float>(radius), sampling::sample_of(set, i),
                            surfaces_, weight_, made.rays);
    for (size_t r = 0; r < kPacket; ++r) {
      const Vec3 aside =
          test::reference_turned(test::reference_on_disc(point(r, 3, i)), normalized(middle));
      const Vec3 toward = normalized(middle + aside * radius);
      const double cosine = dot(toward, smooth_[r]);
      const bool seen = cosine > 0.0 && dot(toward, geometric_[r]) > 0.0;
      if (std::min(std::abs(cosine), std::abs(dot(toward, geometric_[r]))) < kUnit) continue;
      ASSERT_EQ(made.packet.valid[r] != 0, seen) << i << " lane " << r;
      if (!seen) continue;
      ++rays;
      ASSERT_LT(length(direction(made, r) - toward), kUnit);
      ASSERT_NEAR(double{made.rays.weight[r]}, cosine, kUnit);
    }
  }
  EXPECT_GT(rays, 2000);
}

/// The light that a lane gets from one direction, by Lambert and Phong.
struct Reflection {
  Vec3 geometric, smooth, view;
  double specular, shine;

  [[nodiscard]] double of(Vec3 toward) const {
    const double cosine = dot(toward, smooth);
    if (cosine <= 0.0 || dot(toward, geometric) <= 0.0) return 0.0;
    const double along = dot(toward, view) - 2.0 * cosine * dot(smooth, view);
    return cosine + (along > 0.0 ? specular * std::pow(along, shine) : 0.0);
  }
};

struct OverDisc {
  double mean = 0.0, largest = 0.0;
  int hidden = 0;  ///< points without a contribution
};

/// Integrates over a spiral of many points of equal areas.
OverDisc over_disc(const Reflection& reflection, Vec3 middle, double radius) {
  constexpr int kPoints = 20000;
  const double golden = std::numbers::pi * (3.0 - std::sqrt(5.0));
  OverDisc over;
  for (int n = 0; n < kPoints; ++n) {
    const double at = std::sqrt((n + 0.5) / kPoints);
    const Vec3 on_disc{at * std::cos(golden * n), at * std::sin(golden * n), 0.0};
    const double light = reflection.of(
        normalized(middle + test::reference_turned(on_disc, normalized(middle)) * radius));
    over.mean += light / kPoints;
    over.largest = std::max(over.largest, light);
    over.hidden += light == 0.0 ? 1 : 0;
  }
  return over;
}

TEST_P(SampleRays, WholeAreaLightsEqualTheIntegralOverTheirDisc) {
  std::mt19937_64 random(8);
  shading_kernel::Light area_light{};
  area_light.colour[0] = 1.0F;
  alignas(64) std::array<float, kPacket> brings;
  int whole = 0, partly = 0, none = 0;
  for (int round = 0; round < 8; ++round) {
    face_anywhere(random);
    const bool sun = round % 2 == 1;
    const Vec3 middle = any_direction(random) * (sun ? 1.0 : 90.0);
    const double radius = sun ? 0.2 : 18.0;
    place(area_light, sun, middle);
    std::array<Reflection, kPacket> reflections;
    for (size_t r = 0; r < kPacket; ++r) {
      reflections[r] = {geometric_[r], smooth_[r], any_direction(random), r % 2 == 0 ? 0.5 : 0.0,
                        12.0};
      surfaces_.specular[r] = static_cast<float>(reflections[r].specular);
      surfaces_.shine[r] = 12.0F;
      set(surfaces_.view, r, reflections[r].view);
    }
    surfaces_.active[3] = 0;
    const shading_kernel::AreaLightLanes lanes = kernel_.whole_area_light(
        area_light, static_cast<float>(radius), surfaces_, weight_, brings.data());
    EXPECT_EQ(lanes.whole & lanes.partly, 0U);
    for (size_t r = 0; r < kPacket; ++r) {
      const bool is_whole = (lanes.whole >> r & 1) != 0, is_partly = (lanes.partly >> r & 1) != 0;
      if (r == 3) {
        EXPECT_FALSE(is_whole || is_partly);
        continue;
      }
      const OverDisc over = over_disc(reflections[r], middle, radius);
      if (over.hidden == 0) {
        EXPECT_TRUE(is_whole);
        EXPECT_NEAR(double{brings[r]}, over.mean, 2e-3) << "lane " << r;
        ++whole;
      } else if (is_partly || is_whole) {
        // A straight edge across the disc, the horizon of a bent normal, causes an error of the
        // seven points of at most half of the middle's weight.
        EXPECT_NEAR(double{brings[r]}, over.mean, 0.13 * over.largest) << "lane " << r;
        ++partly;
      } else {
        EXPECT_EQ(brings[r], 0.0F);
        EXPECT_LT(over.mean, 0.13 * over.largest + 1e-9);
        ++none;
      }
    }
  }
  EXPECT_GT(whole, 20);
  EXPECT_GT(partly, 5);
  EXPECT_GT(none, 20);
}

/// Compares the baseline with itself, too, since some machines have no other set.
TEST_P(SampleRays, HaveTheSameBitsAsTheBaseline) {
  std::mt19937_64 random(9);
  const shading_kernel::Kernel& plain = shading_kernel_for(Isa::Baseline);
  shading_kernel::Light area_light{};
  area_light.position[1] = 50.0F;
  area_light.colour[0] = 1.0F;
  for (uint32_t i = 0; i < 300; ++i) {
    face_anywhere(random);
    const sampling::SampleSet set = sampling::sample_set(seeds_, i, i);
    const sampling::Sample sample = sampling::sample_of(set, i);
    std::array<Made, 2> around, toward;
    alignas(64) std::array<std::array<float, kPacket>, 2> brings;
    for (size_t k = 0; k < 2; ++k) {
      clear(around[k]);
      clear(toward[k]);
      const shading_kernel::Kernel& kernel = k == 0 ? plain : kernel_;
      kernel.ambient_rays(7.0F, sample, surfaces_, around[k].rays);
      kernel.area_light_rays(area_light, 20.0F, sample, surfaces_, weight_, toward[k].rays);
      kernel.whole_area_light(area_light, 20.0F, surfaces_, weight_, brings[k].data());
      for (Made* made : {&around[k], &toward[k]}) {
        made->rays.packet = nullptr;
        made->rays.valid = nullptr;
      }
    }
    ASSERT_EQ(std::memcmp(&around[0], &around[1], sizeof(Made)), 0) << i;
    ASSERT_EQ(std::memcmp(&toward[0], &toward[1], sizeof(Made)), 0) << i;
    ASSERT_EQ(brings[0], brings[1]) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(InstructionSets, SampleRays,
                         ::testing::ValuesIn(test::every_instruction_set()),
                         [](const auto& isa) { return std::string(isa_name(isa.param)); });

}  // namespace
}  // namespace lenticule::render
