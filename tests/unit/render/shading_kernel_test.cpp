// SPDX-License-Identifier: Apache-2.0
// Tests sixteen lanes in single precision against the formulas in double, and the instruction sets
// against each other.
#include "render/shading/shading_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "base/cpu.h"
#include "frames/linear_codes.h"
#include "frames/srgb.h"
#include "render/accel/ray_stream.h"
#include "render/culling/shaft.h"
#include "render/scene/surface_cells.h"
#include "render/shading/shading.h"
#include "render/shading/shading_tables.h"
#include "tests/support/oracles/whitted_light.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using shading_kernel::Kernel;
using shading_kernel::NewRays;
using shading_kernel::Surfaces;

std::vector<const Kernel*> runnable_kernels() {
  std::vector<const Kernel*> kernels = {&isa_baseline::kShadingKernel};
#if defined(__x86_64__)
  if (isa_supported(Isa::Avx2)) kernels.push_back(&isa_avx2::kShadingKernel);
  if (isa_supported(Isa::Avx512)) kernels.push_back(&isa_avx512::kShadingKernel);
#elif defined(__aarch64__)
  kernels.push_back(&isa_neon::kShadingKernel);
#endif
  return kernels;
}

/// All output of the kernel for one packet and one light.
struct alignas(64) Shaded {
  Surfaces surfaces{};
  float own[kPacket]{};
  NewRays shadow{}, mirrored{};
  RayPacket shadow_packet, mirrored_packet;
};

class ShadingKernel : public ::testing::TestWithParam<test::NamedScene> {
 protected:
  ShadingKernel() : scene_(GetParam().scene, test::make_tiny_stage(), {}, 1) {
    for (size_t r = 0; r < kPacket; ++r) weight_[r] = 0.25F + 0.01F * static_cast<float>(r);
  }

  /// Aims rays from a sphere around the scene toward its middle, some of them invalid.
  void aim(std::mt19937_64& random) {
    std::uniform_real_distribution<double> any(-1.0, 1.0);
    rays_.assign(kPacket, {});
    for (PathRay& ray : rays_) {
      ray.origin = normalized(Vec3{any(random), any(random), any(random)}) * 60.0;
      ray.direction = normalized(Vec3{any(random), any(random), any(random)} * 12.0 - ray.origin);
      ray.channel = static_cast<int>(random() % 3);
      ray.target = random() % 8 == 0 ? PathRay::kInactive : 0;
    }
    load_packet(rays_, packet_);
    intersect16(packet_.valid, scene_.embree, packet_.rays, Coherence::Incoherent);
  }

  /// Shades the packet; returns false if no ray hits.
  bool shade(const Kernel& kernel, size_t light, Shaded& out) {
    std::memset(static_cast<void*>(&out), 0, sizeof out);  // includes the padding
    for (size_t r = 0; r < kPacket; ++r) out.surfaces.channel[r] = rays_[r].channel;
    const ShadingTables& tables = *scene_.shading;
    if (!kernel.find_surfaces(tables.tables(), &packet_.rays.ray.org_x[0], packet_.valid,
                              out.surfaces))
      return false;
    kernel.add_own_light(tables.tables(), out.surfaces, weight_, out.own);
    out.shadow.packet = &out.shadow_packet.rays.ray.org_x[0];
    out.shadow.valid = out.shadow_packet.valid;
    kernel.shadow_rays(tables.lights()[light], out.surfaces, weight_, out.shadow);
    out.mirrored.packet = &out.mirrored_packet.rays.ray.org_x[0];
    out.mirrored.valid = out.mirrored_packet.valid;
    kernel.mirrored_rays(out.surfaces, weight_, out.mirrored);
    out.shadow.packet = out.mirrored.packet = nullptr;  // the bytes are compared
    out.shadow.valid = out.mirrored.valid = nullptr;
    return true;
  }

  void expect_lane_agrees(const Shaded& shaded, size_t light, size_t r) const;

  Scene scene_;
  std::vector<PathRay> rays_;
  RayPacket packet_;
  alignas(64) float weight_[kPacket];
};

Vec3 lane(const float (&v)[3][kPacket], size_t r) {
  return {double{v[0][r]}, double{v[1][r]}, double{v[2][r]}};
}
Vec3 origin_of(const RayPacket& packet, size_t r) {
  const RTCRay16& ray = packet.rays.ray;
  return {double{ray.org_x[r]}, double{ray.org_y[r]}, double{ray.org_z[r]}};
}
Vec3 direction_of(const RayPacket& packet, size_t r) {
  const RTCRay16& ray = packet.rays.ray;
  return {double{ray.dir_x[r]}, double{ray.dir_y[r]}, double{ray.dir_z[r]}};
}

constexpr double kMillimetres = 5e-5;  // a dozen rounding errors of 60, the length of a ray
constexpr double kUnit = 1e-5;

void ShadingKernel::expect_lane_agrees(const Shaded& shaded, size_t light, size_t r) const {
  PathRay ray = rays_[r];
  ray.origin = origin_of(packet_, r);
  ray.direction = normalized(direction_of(packet_, r));
  const Hit hit{.geometry = packet_.rays.hit.geomID[r],
                .primitive = packet_.rays.hit.primID[r],
                .distance = packet_.rays.ray.tfar[r]};
  const Surface expected = surface_at(scene_, ray, hit);
  const Surfaces& s = shaded.surfaces;
  EXPECT_LT(length(lane(s.point, r) - expected.point), kMillimetres);
  EXPECT_LT(length(lane(s.geometric, r) - expected.geometric_normal), kUnit);
  EXPECT_LT(length(lane(s.smooth, r) - expected.shading_normal), kUnit);
  EXPECT_EQ(s.outer_side[r] != 0, expected.outer_side);
  EXPECT_EQ(&scene_.materials[static_cast<size_t>(s.material[r])], expected.material);
  // The kernel's offset is larger than double precision needs, but not much.
  EXPECT_GE(double{s.spawn_offset[r]}, expected.spawn_offset);
  EXPECT_LE(double{s.spawn_offset[r]}, 1e-4 + 4.0 * expected.spawn_offset);

  if (expected.material->texture >= 0) return;  // the tracer looks up its colour
  const double weight = double{weight_[r]};
  EXPECT_NEAR(double{shaded.own[r]},
              weight * test::own_light(expected, scene_.ambient, ray.channel), 1e-6);
  const Arrival at = arrival(scene_.lights[light], spawn_point(expected, Side::Viewer),
                             scene_.frame.units_per_world, ray.channel);
  const double reflected = weight * test::reflected_light(expected, ray.direction, at);
  EXPECT_NEAR(double{shaded.shadow.weight[r]}, reflected, 2e-5);
  if (shaded.shadow_packet.valid[r] != 0) {
    EXPECT_LT(length(direction_of(shaded.shadow_packet, r) - at.toward_light), kUnit);
    EXPECT_LT(length(origin_of(shaded.shadow_packet, r) - expected.point),
              double{s.spawn_offset[r]} + kMillimetres);
  } else {
    EXPECT_LT(reflected, 2e-5);
  }
  if (expected.material->transmittance > 0.0)
    return;  // the tracer computes these in double precision
  const Continuation on = continuation(expected, ray.direction);
  EXPECT_NEAR(double{shaded.mirrored.weight[r]}, weight * on.mirror_weight, 1e-6);
  EXPECT_EQ(shaded.mirrored_packet.valid[r] != 0, on.mirror_weight > 0.0);
  if (on.mirror_weight > 0.0) {
    const Vec3 direction = direction_of(shaded.mirrored_packet, r);
    EXPECT_LT(length(direction - on.mirror_direction), 2.0 * kUnit);
    const DirectionCell bin =
        direction_cell(shaded.mirrored.bin_u[r], shaded.mirrored.bin_v[r], kDirectionBins);
    EXPECT_GE(dot(direction, Vec3(bin.middle)), double{bin.cosine});
  }
}

TEST_P(ShadingKernel, AgreesWithDoublePrecisionLaneByLane) {
  std::mt19937_64 random(7);
  Shaded shaded;
  int lanes = 0;
  for (int round = 0; round < 300; ++round) {
    aim(random);
    const size_t light = random() % scene_.lights.size();
    if (!shade(isa_baseline::kShadingKernel, light, shaded)) continue;
    for (size_t r = 0; r < kPacket; ++r) {
      const bool met = packet_.valid[r] != 0 && packet_.rays.hit.geomID[r] != Hit::kMiss;
      ASSERT_EQ(shaded.surfaces.active[r] != 0, met);
      if (!met) continue;
      ++lanes;
      expect_lane_agrees(shaded, light, r);
      ASSERT_FALSE(HasFailure()) << "round " << round << " lane " << r;
    }
  }
  EXPECT_GT(lanes, 500);
}

/// Includes the first set again, since a machine may have only the baseline.
TEST_P(ShadingKernel, GivesTheSameBitsOnEveryInstructionSet) {
  std::mt19937_64 random(11);
  const std::vector<const Kernel*> kernels = runnable_kernels();
  Shaded first, other;
  for (int round = 0; round < 300; ++round) {
    aim(random);
    const size_t light = random() % scene_.lights.size();
    const bool met = shade(*kernels[0], light, first);
    for (const Kernel* kernel : kernels) {
      ASSERT_EQ(shade(*kernel, light, other), met);
      if (met) {
        ASSERT_EQ(std::memcmp(&first, &other, sizeof first), 0) << "round " << round;
      }
    }
  }
}

TEST(ShadingKernelCodes, OfLinearLightAreThoseOfTheReference) {
  std::vector<float> light = {-1.0F, -0.0F, 0.0F, 1.0F, 2.0F, 1e-40F, INFINITY, -INFINITY, NAN};
  const auto add_with_neighbours = [&](double value) {
    const auto near = static_cast<float>(value);
    for (const float each : {std::nextafter(near, 0.0F), near, std::nextafter(near, 2.0F)})
      light.push_back(each);
  };
  for (int code = 0; code < 255; ++code)
    add_with_neighbours(frames::linear_from_srgb((code + 0.5) / 255.0));
  for (int bin = 0; bin <= frames::LinearCodes::kBins; ++bin)
    add_with_neighbours(static_cast<double>(bin) / frames::LinearCodes::kBins);
  std::mt19937 random(9);
  std::uniform_real_distribution<float> anywhere(0.0F, 1.0F);
  for (int n = 0; n < 100000; ++n) light.push_back(anywhere(random));
  std::vector<uint8_t> expected;
  for (const float value : light) expected.push_back(frames::code_from_linear(double{value}));
  for (const Kernel* kernel : runnable_kernels())
    for (size_t left_out = 0; left_out < 40; ++left_out) {
      std::vector<uint8_t> codes(light.size() + 1, 77);
      const size_t count = light.size() - left_out;
      kernel->encode_linear(frames::linear_codes(), light.data(), static_cast<int32_t>(count),
                            codes.data());
      ASSERT_TRUE(std::equal(codes.begin(), codes.begin() + static_cast<std::ptrdiff_t>(count),
                             expected.begin()));
      ASSERT_EQ(codes[count], 77) << "behind the last one";
    }
}

TEST(ShadingKernelCodes, AreThoseOfTheReference) {
  std::vector<float> light = {-1.0F, -0.0F, 0.0F, 1.0F, 2.0F, 1e-40F, INFINITY, -INFINITY, NAN};
  for (int code = 0; code < 255; ++code) {
    const auto limit = static_cast<float>((code + 0.5) / 255.0);
    for (const float near : {std::nextafter(limit, 0.0F), limit, std::nextafter(limit, 1.0F)})
      light.push_back(near);
  }
  std::vector<uint8_t> expected, codes;
  for (const float value : light) expected.push_back(frames::code_from_encoded(value));
  for (const Kernel* kernel : runnable_kernels())
    for (size_t count = 0; count <= light.size(); ++count) {
      codes.assign(light.size() + 1, 77);
      kernel->encode(light.data(), static_cast<int32_t>(count), codes.data());
      ASSERT_TRUE(std::equal(codes.begin(), codes.begin() + static_cast<std::ptrdiff_t>(count),
                             expected.begin()));
      ASSERT_EQ(codes[count], 77) << "behind the last one";
    }
}

INSTANTIATE_TEST_SUITE_P(TinyScenes, ShadingKernel, ::testing::ValuesIn(test::tiny_scenes()),
                         [](const auto& scene) { return scene.param.name; });

/// Tests one lane that looks straight down at a white floor, lit from a given place.
class Highlight : public ::testing::Test {
 protected:
  static double reflected(double shine, double degrees, shading_kernel::Light light = {}) {
    Surfaces s{};
    s.active[0] = -1;
    s.view[1][0] = -1.0F;
    s.geometric[1][0] = s.smooth[1][0] = 1.0F;
    s.colour[0] = 1.0F;
    s.specular[0] = 1.0F;
    s.shine[0] = static_cast<float>(shine);
    const double angle = degrees * 3.14159265358979323846 / 180.0;
    light.position[0] = static_cast<float>(100.0 * std::sin(angle));
    light.position[1] = static_cast<float>(100.0 * std::cos(angle));
    light.colour[0] = 1.0F;
    alignas(64) float weight[kPacket] = {1.0F};
    RayPacket packet;
    NewRays rays{};
    rays.packet = &packet.rays.ray.org_x[0];
    rays.valid = packet.valid;
    isa_baseline::kShadingKernel.shadow_rays(light, s, weight, rays);
    return double{rays.weight[0]};
  }
};

TEST_F(Highlight, FollowsThePowerFromDullToVerySharp) {
  for (const double shine : {0.0, 0.5, 1.0, 3.0, 27.0, 200.0, 1000.0})
    for (const double degrees : {0.0, 0.5, 3.0, 20.0, 60.0, 89.0}) {
      // Effect of rounding the light's direction to single precision.
      const double tolerance = 1e-6 + 4e-7 * shine;
      EXPECT_NEAR(reflected(shine, degrees),
                  std::pow(std::cos(degrees * 3.14159265358979323846 / 180.0), shine), tolerance)
          << shine << " at " << degrees;
    }
}

TEST_F(Highlight, FollowsTheFalloffOfALight) {
  shading_kernel::Light light{};
  light.falls_off = 1;
  light.world_units_squared = 25.0F;
  EXPECT_NEAR(reflected(1.0, 0.0, light), 25.0 / 1e4, 1e-9);
}

TEST_F(Highlight, OfASpotEndsAtItsOuterCone) {
  shading_kernel::Light light{};
  light.kind = shading_kernel::Light::kSpot;
  light.direction[1] = -1.0F;
  light.cos_outer = 0.9F;
  light.cos_width = 0.1F;
  EXPECT_NEAR(reflected(0.0, 0.0, light), 1.0, 1e-6);
  EXPECT_EQ(reflected(0.0, 27.0, light), 0.0);
  const double inside = (std::cos(10.0 * 3.14159265358979323846 / 180.0) - 0.9) / 0.1;
  EXPECT_NEAR(reflected(0.0, 10.0, light), inside * inside, 1e-5);
}

TEST(ShadingKernelRays, UnusableForEmbreeAreRefused) {
  Surfaces s{};
  for (size_t r = 0; r < kPacket; ++r) {
    s.active[r] = -1;
    s.geometric[1][r] = s.smooth[1][r] = 1.0F;
    s.view[1][r] = -1.0F;
    s.specular[r] = 1.0F;
  }
  s.start[0][2] = 1e30F;
  s.start[1][5] = std::numeric_limits<float>::quiet_NaN();
  s.start[2][9] = -std::numeric_limits<float>::infinity();
  alignas(64) float weight[kPacket];
  std::fill_n(weight, kPacket, 1.0F);
  RayPacket packet;
  for (const Kernel* kernel : runnable_kernels()) {
    NewRays rays{};
    rays.packet = &packet.rays.ray.org_x[0];
    rays.valid = packet.valid;
    EXPECT_TRUE(kernel->mirrored_rays(s, weight, rays));
    EXPECT_EQ(rays.refused, 3);
    for (size_t r = 0; r < kPacket; ++r) {
      EXPECT_EQ(packet.valid[r] == 0, r == 2 || r == 5 || r == 9) << r;
      EXPECT_TRUE(std::isfinite(packet.rays.ray.org_x[r]));
    }
  }
}

}  // namespace
}  // namespace lenticule::render
