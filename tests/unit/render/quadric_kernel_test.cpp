// SPDX-License-Identifier: Apache-2.0
// Tests that packets of rays and single rays give the same bits.
#include "render/accel/quadric_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "base/cpu.h"
#include "render/accel/embree.h"
#include "render/accel/primitives.h"
#include "render/accel/user_geometry.h"
#include "tests/support/instruction_sets.h"

namespace lenticule::render {
namespace {

constexpr size_t kLanes = quadric_kernel::kMostLanes;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct alignas(64) Packet {
  RTCRayHit16 rays;
  int valid[kLanes];
};

/// Cuts a packet into narrower ones, as Embree does where its vectors are narrower.
class Parts {
 public:
  Parts(Packet& whole, size_t lanes) : whole_(whole), lanes_(lanes) {}

  template <class Use>
  void each(const Use& use) {
    constexpr size_t kFields = sizeof(RTCRayHit16) / (4 * kLanes);
    std::vector<float> part(kFields * lanes_);
    auto* whole = reinterpret_cast<unsigned char*>(&whole_.rays);
    for (size_t first = 0; first < kLanes; first += lanes_) {
      const auto field = [&](size_t f) { return whole + 4 * (f * kLanes + first); };
      for (size_t f = 0; f < kFields; ++f)
        std::memcpy(part.data() + f * lanes_, field(f), 4 * lanes_);
      use({static_cast<int>(lanes_), whole_.valid + first, part.data()});
      for (size_t f = 0; f < kFields; ++f)
        std::memcpy(field(f), part.data() + f * lanes_, 4 * lanes_);
    }
  }

 private:
  Packet& whole_;
  size_t lanes_;
};

class QuadricKernel : public ::testing::TestWithParam<Isa> {
 protected:
  [[nodiscard]] static const quadric_kernel::Kernel& kernel() {
    return quadric_kernel_for(GetParam());
  }

  double any() { return uniform_(random_); }
  Vec3 vector() { return {any(), any(), any()}; }

  /// Returns rays around the origin, some parallel to an axis, some that start or end in the
  /// middle.
  Packet packet() {
    Packet packet;
    std::memset(static_cast<void*>(&packet), 0, sizeof packet);
    RTCRay16& ray = packet.rays.ray;
    for (size_t r = 0; r < kLanes; ++r) {
      const Vec3 origin = vector() * (r % 3 == 0 ? 50.0 : 2.0);
      Vec3 direction = r % 5 == 0 ? vector() : vector() * 1.5 - origin;
      if (r % 7 == 0) direction = {0, direction.y, 0};
      ray.org_x[r] = static_cast<float>(origin.x);
      ray.org_y[r] = static_cast<float>(origin.y);
      ray.org_z[r] = static_cast<float>(origin.z);
      ray.dir_x[r] = static_cast<float>(direction.x);
      ray.dir_y[r] = static_cast<float>(direction.y);
      ray.dir_z[r] = static_cast<float>(direction.z);
      ray.tnear[r] = r % 4 == 0 ? static_cast<float>(std::abs(any())) : 0.0F;
      ray.tfar[r] = r % 2 == 0 ? kInfinity : static_cast<float>(std::abs(any()) * 2.0);
      packet.rays.hit.geomID[r] = packet.rays.hit.primID[r] = 77;
      packet.valid[r] = random_() % 5 == 0 ? 0 : -1;
    }
    return packet;
  }

  template <class Shape>
  static double distance(const Shape& shape, const RTCRay16& ray, size_t r) {
    const Vec3 origin{double{ray.org_x[r]}, double{ray.org_y[r]}, double{ray.org_z[r]}};
    const Vec3 direction{double{ray.dir_x[r]}, double{ray.dir_y[r]}, double{ray.dir_z[r]}};
    return first_root(meet(shape, origin, direction), double{ray.tnear[r]}, double{ray.tfar[r]});
  }

  /// Returns the number of lanes that hit the shape.
  template <class Shape, class Intersect>
  int expect_same_hits(const Shape& shape, const Intersect& intersect) {
    const Packet before = packet();
    Packet after = before;
    Parts(after, lanes_).each(intersect);
    int met = 0;
    for (size_t r = 0; r < kLanes; ++r) {
      const auto t = static_cast<float>(distance(shape, before.rays.ray, r));
      const bool meets = before.valid[r] != 0 && t < before.rays.ray.tfar[r];
      EXPECT_EQ(after.valid[r], meets ? -1 : 0);
      EXPECT_EQ(after.rays.ray.tfar[r], meets ? t : before.rays.ray.tfar[r]);
      EXPECT_EQ(after.rays.hit.geomID[r], meets ? 5U : 77U);
      EXPECT_EQ(after.rays.hit.primID[r], meets ? 6U : 77U);
      met += meets ? 1 : 0;
    }
    return met;
  }

  template <class Shape, class Occlude>
  void expect_same_shadows(const Shape& shape, const Occlude& occlude) {
    const Packet before = packet();
    Packet after = before;
    Parts(after, lanes_).each(occlude);
    next_width();
    for (size_t r = 0; r < kLanes; ++r) {
      const bool meets = before.valid[r] != 0 &&
                         distance(shape, before.rays.ray, r) < double{before.rays.ray.tfar[r]};
      EXPECT_EQ(after.valid[r], meets ? -1 : 0);
      EXPECT_EQ(after.rays.ray.tfar[r], meets ? -kInfinity : before.rays.ray.tfar[r]);
    }
  }

  /// Widths 16, 8 and, if the kernel supports it, 4.
  void next_width() {
    const auto step = static_cast<size_t>(kernel().step);
    lanes_ = lanes_ / 2 < std::max<size_t>(step, 4) ? kLanes : lanes_ / 2;
  }

  size_t lanes_ = kLanes;
  std::mt19937_64 random_{99};
  std::uniform_real_distribution<double> uniform_{-1.0, 1.0};
};

TEST_P(QuadricKernel, IntersectsSpheresLikeSingleRays) {
  int met = 0;
  for (int round = 0; round < 3000; ++round) {
    const SphereShape sphere{.centre = vector(), .radius = 0.01 + std::abs(any())};
    const quadric_kernel::Sphere lanes{
        .centre = {sphere.centre.x, sphere.centre.y, sphere.centre.z}, .radius = sphere.radius};
    met += expect_same_hits(sphere, [&](const quadric_kernel::Packet& rays) {
      kernel().intersect_sphere(lanes, 5, 6, rays);
    });
    expect_same_shadows(
        sphere, [&](const quadric_kernel::Packet& rays) { kernel().occlude_sphere(lanes, rays); });
    ASSERT_FALSE(HasFailure()) << "round " << round;
  }
  EXPECT_GT(met, 2500);
}

TEST_P(QuadricKernel, IntersectsConesLikeSingleRays) {
  int met = 0;
  for (int round = 0; round < 3000; ++round) {
    const Vec3 base = vector(), apex = round % 10 == 0 ? base + Vec3{0, 1, 0} : vector();
    const double height = length(apex - base);
    const double base_radius = std::abs(any());
    const double apex_radius = round % 3 == 0   ? base_radius
                               : round % 4 == 0 ? 0.0
                                                : std::abs(any());
    const ConeShape cone{.base = base,
                         .axis = (apex - base) / height,
                         .height = height,
                         .base_radius = base_radius,
                         .slope = (apex_radius - base_radius) / height};
    const quadric_kernel::Cone lanes{.base = {cone.base.x, cone.base.y, cone.base.z},
                                     .axis = {cone.axis.x, cone.axis.y, cone.axis.z},
                                     .height = cone.height,
                                     .base_radius = cone.base_radius,
                                     .slope = cone.slope};
    met += expect_same_hits(cone, [&](const quadric_kernel::Packet& rays) {
      kernel().intersect_cone(lanes, 5, 6, rays);
    });
    expect_same_shadows(
        cone, [&](const quadric_kernel::Packet& rays) { kernel().occlude_cone(lanes, rays); });
    ASSERT_FALSE(HasFailure()) << "round " << round;
  }
  EXPECT_GT(met, 2500);
}

TEST_P(QuadricKernel, IntersectsWideTrianglesLikeSingleRays) {
  const auto copy = [](Vec3 v, double(&out)[3]) {
    out[0] = v.x;
    out[1] = v.y;
    out[2] = v.z;
  };
  int met = 0;
  for (int round = 0; round < 3000; ++round) {
    const double size = std::pow(10.0, round % 7);
    const Vec3 along = vector() * size, aside = vector() * size;
    const Vec3 corner = vector() - along * 0.3 - aside * 0.3;
    const WideTriangle triangle = make_wide_triangle({corner, corner + along, corner + aside});
    quadric_kernel::Triangle lanes{.corner = {},
                                   .normal = {},
                                   .u_axis = {},
                                   .v_axis = {},
                                   .slope = {},
                                   .edge_room = kEdgeRoom};
    copy(corner, lanes.corner);
    copy(triangle.normal, lanes.normal);
    copy(triangle.u_axis, lanes.u_axis);
    copy(triangle.v_axis, lanes.v_axis);
    copy(triangle.slope, lanes.slope);
    met += expect_same_hits(triangle, [&](const quadric_kernel::Packet& rays) {
      kernel().intersect_triangle(lanes, 5, 6, rays);
    });
    expect_same_shadows(triangle, [&](const quadric_kernel::Packet& rays) {
      kernel().occlude_triangle(lanes, rays);
    });
    ASSERT_FALSE(HasFailure()) << "round " << round;
  }
  EXPECT_GT(met, 2500);
}

INSTANTIATE_TEST_SUITE_P(InstructionSets, QuadricKernel,
                         ::testing::ValuesIn(test::every_instruction_set()),
                         [](const auto& isa) { return std::string(isa_name(isa.param)); });

}  // namespace
}  // namespace lenticule::render
