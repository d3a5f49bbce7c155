// SPDX-License-Identifier: Apache-2.0
// Tests the fast map against the slow reference: random subpixels of a thousand random rigs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "optics/rig_file.h"
#include "optics/row_rays.h"
#include "tests/support/oracles/optics_oracle.h"
#include "tests/support/random_rigs.h"

namespace lenticule::optics {
namespace {

using test::oracle_phase;
using test::Real;
using test::RealEye;
using test::RealPoint;

/// Returns the eye that a ray reaches, from the ray alone.
RealEye eye_of(const Rig& rig, double lens_x_mm, double lens_y_mm, double tan_x, double tan_y) {
  const Real z = rig.viewing.distance.value;
  if (std::isinf(z)) return {tan_x, tan_y, z};
  return {static_cast<Real>(lens_x_mm) + z * static_cast<Real>(tan_x),
          static_cast<Real>(lens_y_mm) + z * static_cast<Real>(tan_y), z};
}

RealPoint centre_px(const Rig& rig, int i, int j, int channel) {
  const SubpixelOffset& offset = rig.panel.layout.offset(i, j, channel);
  return {static_cast<Real>(i) + static_cast<Real>(offset.x_px),
          static_cast<Real>(j) + static_cast<Real>(offset.y_px)};
}

struct Errors {
  double place = 0.0;       // lenses
  double round_trip = 0.0;  // lenses
  double eye_height = 0.0;  // mm over the distance
  long subpixels = 0;
  long on_border = 0;

  void raise(double& worst, Real error) {
    // The comparison makes NaN the worst error.
    const double size = static_cast<double>(std::fabs(error));
    worst = size <= worst ? worst : size;
  }
};

/// Checks one subpixel of the fast map: its lens and place, and that its own eye sees it through
/// that lens.
void check(const OpticalModel& model, const RowRays& rays, size_t s, int i, int j, int channel,
           Errors& errors) {
  const Rig& rig = model.rig();
  const RealPoint at_px = centre_px(rig, i, j, channel);
  const Eye& centre = model.design_eye();
  const Real seen = oracle_phase(rig, at_px, channel, test::real_eye(centre));
  const Real lens = std::floor(seen + Real(0.5));
  ++errors.subpixels;
  if (static_cast<long>(lens) != rays.lens[s]) {
    // Possible at a border only: +1/2 in one lens and -1/2 in the next are the same place.
    errors.raise(errors.place, std::fabs(seen - rays.lens[s]) - Real(0.5));
    ++errors.on_border;
  } else {
    errors.raise(errors.place, seen - lens - rays.place[s]);
  }
  RealEye eye = eye_of(rig, rays.lens_x_mm[s], rays.lens_y_mm[s], rays.tan_x[s], rays.tan_y[s]);
  if (!std::isinf(centre.z_mm)) errors.raise(errors.eye_height, (eye.y - centre.y) / centre.z_mm);
  errors.raise(errors.round_trip, oracle_phase(rig, at_px, channel, eye) - rays.lens[s]);
}

TEST(FastMap, IsWithinANanolensOfTheReferenceForRandomSubpixelsOfAThousandRigs) {
  constexpr int kRigs = 1000, kPixelsPerRig = 34;
  std::mt19937_64 random(20240531);
  Errors errors;
  RowRays rays;
  for (int r = 0; r < kRigs; ++r) {
    const OpticalModel model(test::random_rig(random));
    const RowRayEvaluator evaluator(model);
    const Panel& panel = model.rig().panel;
    for (int n = 0; n < kPixelsPerRig; ++n) {
      // The corners first, then random subpixels.
      const int i = n < 4 ? (n % 2) * (panel.width_px - 1)
                          : static_cast<int>(random() % static_cast<uint64_t>(panel.width_px));
      const int j = n < 4 ? (n / 2) * (panel.height_px - 1)
                          : static_cast<int>(random() % static_cast<uint64_t>(panel.height_px));
      evaluator.evaluate(j, i, i + 1, rays);
      for (int c = 0; c < 3; ++c) check(model, rays, static_cast<size_t>(c), i, j, c, errors);
      ASSERT_LT(errors.place, 1e-9) << "rig " << r << " subpixel " << i << ", " << j;
      ASSERT_LT(errors.round_trip, 1e-9) << "rig " << r << " subpixel " << i << ", " << j;
    }
  }
  EXPECT_GE(errors.subpixels, 100'000);
  EXPECT_LT(errors.on_border, errors.subpixels / 1000);
  EXPECT_LT(errors.eye_height, 1e-12);
  std::printf("%ld subpixels: place within %.2g lens, subpixel -> ray -> eye -> lens within %.2g\n",
              errors.subpixels, errors.place, errors.round_trip);
  RecordProperty("worst_place_lenses", std::to_string(errors.place));
}

/// Returns an extreme rig that the validator accepts.
Rig wild_rig(std::mt19937_64& random) {
  const auto wild = [&](double low, double high) {  // uniform over the orders of magnitude
    return low * std::pow(high / low, static_cast<double>(random() >> 11) * 0x1p-53);
  };
  const auto sign = [&] { return random() % 2 == 0 ? 1.0 : -1.0; };
  Rig rig;
  rig.panel.width_px = static_cast<int>(wild(1, 32768));
  rig.panel.height_px = static_cast<int>(wild(1, 32768));
  rig.panel.pixel_width = Millimetres(wild(1e-3, 10.0));
  rig.panel.pixel_height = Millimetres(rig.panel.pixel_width.value * wild(0.2, 5.0));
  rig.sheet.pitch = Subpixels(wild(1.5, 3000.0));
  rig.sheet.slant = sign() * wild(0.01, 4.0);
  const double lens_mm = rig.sheet.pitch.value * rig.panel.pixel_width.value / 3.0;
  rig.sheet.gap = Millimetres(lens_mm * wild(0.3, 30.0));
  rig.sheet.refraction_shape = random() % 3 == 0 ? 0.0 : wild(0.1, 1.0);
  if (random() % 2 == 0) {
    const int columns = 2 + static_cast<int>(random() % 8);
    rig.sheet.residual = test::random_residual(random, columns, 2, wild(0.01, 100.0));
  }
  if (random() % 4 != 0) {
    rig.viewing.distance = Millimetres(wild(0.5, 1e6));
    rig.viewing.height = Millimetres(sign() * rig.viewing.distance.value * wild(1e-3, 10.0));
  }
  return rig;
}

TEST(FastMap, IsCorrectOnExtremeValidRigs) {
  std::mt19937_64 random(5150);
  RowRays rays;
  Errors errors;
  int valid = 0;
  for (int tries = 0; tries < 20000 && valid < 1500; ++tries) {
    const Rig rig = wild_rig(random);
    if (find_problem(rig)) continue;
    ++valid;
    const OpticalModel model(rig);
    const RowRayEvaluator evaluator(model);
    for (int n = 0; n < 9; ++n) {
      const int i = (n % 3) * (rig.panel.width_px - 1) / 2;
      const int j = (n / 3) * (rig.panel.height_px - 1) / 2;
      evaluator.evaluate(j, i, i + 1, rays);
      ASSERT_TRUE(std::isfinite(rays.tan_x[1]) && std::isfinite(rays.lens_x_mm[1]) &&
                  std::isfinite(rays.place[1]))
          << rig_to_toml(rig);
      check(model, rays, 1, i, j, 1, errors);
      ASSERT_LT(errors.place, 1e-6) << "rig " << valid;
      ASSERT_LT(errors.round_trip, 1e-6) << "rig " << valid;
      const SubpixelRay ray = model.ray(i, j, 1);
      ASSERT_TRUE(ray.lens != rays.lens[1] ||
                  std::abs(ray.tan_x - rays.tan_x[1]) <= 1e-6 * (1.0 + std::abs(ray.tan_x)));
    }
  }
  EXPECT_GE(valid, 500);
  std::printf("%d wild rigs: place within %.2g lens, round trip within %.2g\n", valid, errors.place,
              errors.round_trip);
}

TEST(FastMap, GivesTheReferencesRays) {
  std::mt19937_64 random(7);
  RowRays rays;
  double position = 0.0, direction = 0.0;
  for (int r = 0; r < 60; ++r) {
    const OpticalModel model(test::random_rig(random));
    const RowRayEvaluator evaluator(model);
    const Rig& rig = model.rig();
    for (int n = 0; n < 8; ++n) {
      const int i = static_cast<int>(random() % static_cast<uint64_t>(rig.panel.width_px));
      const int j = static_cast<int>(random() % static_cast<uint64_t>(rig.panel.height_px));
      const int c = n % 3;
      const test::RealRay slow = test::oracle_ray(rig, i, j, c);
      if (std::fabs(slow.place) > Real(0.4999999)) continue;
      evaluator.evaluate(j, i, i + 1, rays);
      const auto s = static_cast<size_t>(c);
      ASSERT_EQ(rays.lens[s], slow.lens);
      const auto worst = [](double& so_far, Real error) {
        so_far = std::max(so_far, static_cast<double>(std::fabs(error)));
      };
      worst(position, slow.lens_point.x - static_cast<Real>(rays.lens_x_mm[s]));
      worst(position, slow.lens_point.y - static_cast<Real>(rays.lens_y_mm[s]));
      worst(direction, slow.tan_x - static_cast<Real>(rays.tan_x[s]));
      worst(direction, slow.tan_y - static_cast<Real>(rays.tan_y[s]));
    }
  }
  EXPECT_LT(position, 1e-9);   // mm
  EXPECT_LT(direction, 1e-9);  // tangents
  std::printf("rays within %.2g mm and %.2g in direction\n", position, direction);
}

TEST(ScalarModel, AgreesWithTheFastMap) {
  std::mt19937_64 random(11);
  RowRays rays;
  for (int r = 0; r < 100; ++r) {
    const OpticalModel model(test::random_rig(random));
    const Panel& panel = model.rig().panel;
    const int j = static_cast<int>(random() % static_cast<uint64_t>(panel.height_px));
    const int end = std::min(panel.width_px, 400);
    RowRayEvaluator(model).evaluate(j, 0, end, rays);
    for (int i = 0; i < end; ++i) {
      for (int c = 0; c < 3; ++c) {
        const SubpixelRay ray = model.ray(i, j, c);
        const auto s = static_cast<size_t>(3 * i + c);
        if (ray.lens != rays.lens[s]) {
          ASSERT_GT(std::abs(ray.place), 0.5 - 1e-9);
          continue;
        }
        ASSERT_NEAR(ray.place, rays.place[s], 1e-9);
        ASSERT_NEAR(ray.lens_x_mm, rays.lens_x_mm[s], 1e-9);
        ASSERT_NEAR(ray.lens_y_mm, rays.lens_y_mm[s], 1e-9);
        ASSERT_NEAR(ray.tan_x, rays.tan_x[s], 1e-9);
        ASSERT_NEAR(ray.tan_y, rays.tan_y[s], 1e-9);
      }
    }
  }
}

TEST(ScalarModel, GivesTheReferencesPhaseForAnyEye) {
  std::mt19937_64 random(13);
  for (int r = 0; r < 200; ++r) {
    const OpticalModel model(test::random_rig(random));
    const Panel& panel = model.rig().panel;
    for (int n = 0; n < 20; ++n) {
      const auto unit = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
      const double x = panel.width_px * unit(), y = panel.height_px * unit();
      const Eye eye = n % 5 == 0
                          ? Eye{unit() - 0.5, unit() - 0.5, std::numeric_limits<double>::infinity()}
                          : Eye{2000 * (unit() - 0.5), 2000 * (unit() - 0.5), 100 + 3000 * unit()};
      const Real slow = oracle_phase(model.rig(), {x, y}, n % 3, test::real_eye(eye));
      ASSERT_NEAR(model.phase(x, y, n % 3, eye), static_cast<double>(slow), 1e-9);
    }
  }
}

}  // namespace
}  // namespace lenticule::optics
