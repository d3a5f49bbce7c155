// SPDX-License-Identifier: Apache-2.0
// Tests the ground truth for calibrations against a slow tracer with independent code, and against
// the laws of thin lenses.
#include <gtest/gtest.h>

#include <cmath>

#include "bench_stage.h"
#include "lab/panel/simulated_bench.h"

namespace lenticule::lab {
namespace {

using Real = long double;

/// A ray in the coordinates of a lens: u across, v along, z up, apex at the origin.
struct SlowRay {
  Real u, v, z;
  Real du, dv, dz;
};

/// Refracts a ray by splitting its direction into the parts along and across the surface.
bool bend(SlowRay& ray, Real normal_u, Real normal_z, Real index_before, Real index_after) {
  const Real length = std::sqrt(ray.du * ray.du + ray.dv * ray.dv + ray.dz * ray.dz);
  const Real u = ray.du / length, v = ray.dv / length, z = ray.dz / length;
  const Real inward = u * normal_u + z * normal_z;
  const Real ratio = index_before / index_after;
  const Real along_u = ratio * (u - inward * normal_u);
  const Real along_v = ratio * v;
  const Real along_z = ratio * (z - inward * normal_z);
  const Real squared = along_u * along_u + along_v * along_v + along_z * along_z;
  if (inward >= 0 || squared >= 1) return false;
  const Real across = -std::sqrt(1 - squared);
  ray.du = along_u + across * normal_u;
  ray.dv = along_v;
  ray.dz = along_z + across * normal_z;
  return true;
}

void drop_to(SlowRay& ray, Real z) {
  const Real way = (z - ray.z) / ray.dz;
  ray.u += way * ray.du;
  ray.v += way * ray.dv;
  ray.z = z;
}

/// Returns the height of the ray above the lens surface after `way` along its direction.
Real above_surface(const SimulatedSheet& sheet, const SlowRay& ray, Real way) {
  const Real u = ray.u + way * ray.du;
  const Real radius = sheet.radius_mm;
  const Real sag = radius - std::sqrt(radius * radius - u * u);
  return ray.z + way * ray.dz - (sheet.lens_toward_panel ? sag : -sag);
}

/// Finds the lens surface by bisection; false if the ray leaves the lens sideways.
bool walk_to_surface(const SimulatedSheet& sheet, Real half_pitch, SlowRay& ray) {
  Real low = (0.3L * half_pitch - ray.z) / ray.dz;  // certainly above the surface: sags are smaller
  Real high = (-0.3L * half_pitch - ray.z) / ray.dz;  // certainly below the surface
  for (int step = 0; step < 62; ++step) {
    const Real middle = (low + high) / 2;
    (above_surface(sheet, ray, middle) > 0 ? low : high) = middle;
  }
  ray.u += low * ray.du;
  ray.v += low * ray.dv;
  ray.z += low * ray.dz;
  return std::abs(ray.u) <= half_pitch;
}

/// Traces one ray that aims at (u, 0, 0) from the eye; false if the ray misses this lens.
bool follow(const SimulatedSheet& sheet, int channel, Real half_pitch, Real u, Vec3 eye, Real& at_u,
            Real& at_v) {
  const Real index = sheet.index[static_cast<size_t>(channel)];
  SlowRay ray{eye.x, eye.y, eye.z, u - eye.x, -eye.y, -eye.z};
  if (sheet.lens_toward_panel) {
    drop_to(ray, sheet.thickness_mm);
    if (!bend(ray, 0, 1, 1, index)) return false;
  }
  if (!walk_to_surface(sheet, half_pitch * (1 - Real{sheet.valley}), ray)) return false;
  const Real side = sheet.lens_toward_panel ? -1 : 1;
  const Real radius = sheet.radius_mm;
  const Real normal_u = side * ray.u / radius;
  const Real normal_z = std::sqrt(1 - normal_u * normal_u);
  const bool enters = !sheet.lens_toward_panel;
  if (!bend(ray, normal_u, normal_z, enters ? 1 : index, enters ? index : 1)) return false;
  if (enters) {
    drop_to(ray, -sheet.thickness_mm);
    if (sheet.gap_mm > 0 && !bend(ray, 0, 1, index, sheet.gap_index)) return false;
    drop_to(ray, -Real{sheet.thickness_mm} - sheet.gap_mm);
  } else {
    drop_to(ray, -sheet.gap_mm);
  }
  at_u = ray.u;
  at_v = ray.v;
  return true;
}

struct SlowMean {
  Real u = 0;
  Real v = 0;
};

/// Returns the mean panel position of evenly spread rays from the eye through the lens at 0.
SlowMean slow_mean(const SimulatedSheet& sheet, int channel, Real pitch, Vec3 eye) {
  constexpr int kRays = 20000;
  SlowMean sum;
  int count = 0;
  for (int n = 0; n < kRays; ++n) {
    const Real aim = pitch * ((n + 0.5L) / kRays - 0.5L) * 6;
    Real u = 0, v = 0;
    if (!follow(sheet, channel, pitch / 2, aim, eye, u, v)) continue;
    sum.u += u;
    sum.v += v;
    ++count;
  }
  return {sum.u / count, sum.v / count};
}

/// A perfect flat sheet over square pixels.
struct SlowSheet {
  const SimulatedSheet& sheet;
  int channel;
  Real pitch_mm;            // along a row
  Real across_x, across_y;  // unit vector

  SlowSheet(const optics::Panel& panel, const SimulatedSheet& s, int c)
      : sheet(s), channel(c), pitch_mm(Real{s.pitch_subpx} / 3 * panel.pixel_width.value) {
    const Real turn = std::sqrt(1 + Real{s.slant} * s.slant);
    across_x = 1 / turn;
    across_y = -s.slant / turn;
  }

  /// Returns how far, across the lens, light from the eye misses `point` after the lens whose apex
  /// line passes `apex_x` in the point's row. The ray goes through the place of the apex line from
  /// which the miss along the lens is zero.
  [[nodiscard]] Real miss(Real apex_x, Vec2 point, Vec3 eye) const {
    Real slide = 0;
    SlowMean mean;
    for (int step = 0; step < 4; ++step) {
      const Real from_x = eye.x - apex_x + slide * across_y;
      const Real from_y = eye.y - point.y - slide * across_x;
      const Vec3 local{static_cast<double>(across_x * from_x + across_y * from_y),
                       static_cast<double>(across_x * from_y - across_y * from_x), eye.z};
      mean = slow_mean(sheet, channel, pitch_mm * across_x, local);
      slide = -mean.v + (apex_x - point.x) * across_y;
    }
    return (apex_x - point.x) * across_x + mean.u;
  }
};

/// Returns the coordinate of the lens that shows the panel point to the eye: two places of the row
/// are tried, and the rest is linear.
Real slow_phase(const optics::Panel& panel, const SimulatedSheet& sheet, int channel, Vec2 point,
                Vec3 eye) {
  const SlowSheet slow(panel, sheet, channel);
  const Real first = point.x + (eye.x - point.x) * sheet.thickness_mm / sheet.index[0] / eye.z;
  const Real miss_of_first = slow.miss(first, point, eye);
  const Real second = first - miss_of_first / slow.across_x;
  const Real miss_of_second = slow.miss(second, point, eye);
  const Real slope = (miss_of_second - miss_of_first) / (second - first);
  const Real apex_x = second - miss_of_second / slope;
  return (apex_x - Real{sheet.slant} * point.y) / slow.pitch_mm + sheet.offset_lenses;
}

const Vec2 kPlaces[] = {{320, 180}, {630, 350}, {600, 30}};

void expect_slow_tracer_agrees(const SimulatedSheet& sheet, int channel) {
  const optics::Panel panel = small_panel();
  const SimulatedBench bench(panel, sheet, {}, quiet_camera(), 1);
  const Vec3 eye{-60, 45, 330};
  for (const Vec2 at : kPlaces) {
    const Real slow = slow_phase(panel, sheet, channel, {panel.x_mm(at.x), panel.y_mm(at.y)}, eye);
    // The slow tracer resolves the rim of the lens to a 3000th: with 30 times as many rays the
    // largest difference was 1.2e-6.
    EXPECT_NEAR(bench.ground_truth_phase(at.x, at.y, channel, eye), static_cast<double>(slow), 1e-4)
        << at.x << ", " << at.y;
  }
}

TEST(GroundTruthPhase, AgreesWithASlowTracer) {
  SimulatedSheet sheet = focused_sheet(small_panel(), 7.7, 0.25, 16.0);
  sheet.index = {1.49, 1.50, 1.51};
  sheet.offset_lenses = 0.3;
  sheet.thickness_mm *= 0.93;  // out of focus, where the weights of the rays matter
  expect_slow_tracer_agrees(sheet, 2);
}

TEST(GroundTruthPhase, AgreesWithASlowTracerBehindAnAirGap) {
  SimulatedSheet sheet = focused_sheet(small_panel(), 9.1, -0.4, 16.0);
  sheet.thickness_mm *= 0.6;
  sheet.gap_mm = 0.5;
  expect_slow_tracer_agrees(sheet, 1);
}

TEST(GroundTruthPhase, AgreesWithASlowTracerOverGlassAndBetweenValleys) {
  SimulatedSheet sheet = focused_sheet(small_panel(), 7.7, 0.25, 16.0);
  sheet.thickness_mm *= 0.7;
  sheet.gap_mm = 0.5;
  sheet.gap_index = 1.52;
  sheet.valley = 0.06;
  expect_slow_tracer_agrees(sheet, 1);
}

TEST(GroundTruthPhase, AgreesWithASlowTracerWhenTheLensesFaceThePanel) {
  SimulatedSheet sheet = focused_sheet(small_panel(), 7.7, 0.2, 16.0);
  sheet.lens_toward_panel = true;
  sheet.gap_mm = sheet.radius_mm / (sheet.index[1] - 1.0) * 0.95;
  sheet.thickness_mm = 2.0;
  expect_slow_tracer_agrees(sheet, 0);
}

/// Returns the lens coordinate of a chief ray through flat slabs, solved in the plane of lens and
/// eye.
double slab_phase(const optics::Panel& panel, const SimulatedSheet& sheet, Vec2 at, Vec3 eye) {
  const ChiefRay chief = chief_ray(sheet, 1);
  const Vec2 q{panel.x_mm(at.x), panel.y_mm(at.y)};
  Vec2 lens = q;
  for (int step = 0; step < 50; ++step) {
    const Vec2 r{eye.x - lens.x, eye.y - lens.y};
    const double squared = r.x * r.x + r.y * r.y;
    const double part =
        chief.gap_mm / std::sqrt(eye.z * eye.z + (1.0 - chief.refraction_shape) * squared);
    lens = q + r * part;
  }
  return 3.0 / sheet.pitch_subpx / panel.pixel_width.value * (lens.x - sheet.slant * lens.y) +
         sheet.offset_lenses;
}

TEST(GroundTruthPhase, FollowsTheSlabLawForThinLenses) {
  const optics::Panel panel = small_panel();
  const Vec3 eye{-60, 45, 330};
  // Lenses much narrower than their focal length have no aberrations, and the slab causes nearly
  // all of the shift. The remaining difference shrinks with the square of the lens's width.
  double worst[2] = {};
  for (int narrow = 0; narrow < 2; ++narrow) {
    SimulatedSheet sheet = focused_sheet(panel, 7.7, 0.25, narrow == 1 ? 2.0 : 4.0);
    const SimulatedBench bench(panel, sheet, {}, quiet_camera(), 1);
    const double gap = chief_ray(sheet, 1).gap_mm;
    const double lenses_per_mm = 3.0 / sheet.pitch_subpx / panel.pixel_width.value;
    for (const Vec2 at : kPlaces) {
      const double miss = std::abs(bench.ground_truth_phase(at.x, at.y, 1, eye) -
                                   slab_phase(panel, sheet, at, eye));
      worst[narrow] = std::max(worst[narrow], miss / (gap * lenses_per_mm));
    }
  }
  EXPECT_LT(worst[0], 4e-4);
  EXPECT_GT(worst[0], 1e-7);  // real lenses differ
  EXPECT_NEAR(worst[0] / worst[1], 4.0, 0.4);
}

TEST(GroundTruthPhase, IsTheLensCoordinateStraightAhead) {
  const optics::Panel panel = small_panel();
  SimulatedSheet sheet = focused_sheet(panel, 7.7, 0.25);
  sheet.offset_lenses = 0.4;
  const SimulatedBench bench(panel, sheet, {}, quiet_camera(), 1);
  const Vec2 at{400.25, 100.5};
  const Vec3 eye{panel.x_mm(at.x), panel.y_mm(at.y), 500};
  const double expected = 3.0 * ((at.x - 320) + 0.25 * (at.y - 180)) / 7.7 + 0.4;
  EXPECT_NEAR(bench.ground_truth_phase(at.x, at.y, 0, eye), expected, 1e-9);
}

TEST(GroundTruthPhase, StretchesWithHeat) {
  const optics::Panel panel = small_panel();
  const SimulatedSheet sheet = focused_sheet(panel, 7.7, 0.0);
  SimulatedBench bench(panel, sheet, {}, quiet_camera(), 1);
  const Vec3 eye{panel.x_mm(620), 0, 1e6};
  const double cold = bench.ground_truth_phase(620, 180, 1, eye);
  bench.set_thermal_stretch(1e-3);
  EXPECT_NEAR(bench.ground_truth_phase(620, 180, 1, eye), cold / 1.001, 1e-9);
}

TEST(GroundTruthPhase, SeesTheBowOfTheGapInTheCorners) {
  const optics::Panel panel = small_panel();
  SimulatedSheet sheet = focused_sheet(panel, 7.7, 0.0);
  SimulatedSheet bowed = sheet;
  bowed.gap_bow = 0.06;
  const SimulatedBench flat_bench(panel, sheet, {}, quiet_camera(), 1);
  const SimulatedBench bowed_bench(panel, bowed, {}, quiet_camera(), 1);
  const Vec3 eye{150, 0, 400};
  const auto shift = [&](const SimulatedBench& bench, double x, double y) {
    return bench.ground_truth_phase(x, y, 1, eye) - 3.0 * (x - 320) / 7.7;
  };
  // (1 + 6 % / 3) in the middle, (1 - 6 % 2/3) in a corner.
  EXPECT_NEAR(shift(bowed_bench, 320, 180) / shift(flat_bench, 320, 180), 1.02, 2e-3);
  EXPECT_NEAR(shift(bowed_bench, 1, 1) / shift(flat_bench, 1, 1), 0.96, 2e-3);
}

TEST(GroundTruthPhase, DeformsWithoutChangingPitchSlantAndOffset) {
  const optics::Panel panel = small_panel();
  SimulatedSheet sheet = focused_sheet(panel, 7.7, 0.25);
  const SimulatedBench straight(panel, sheet, {}, quiet_camera(), 1);
  sheet.deformation_lenses = 0.1;
  const SimulatedBench bent(panel, sheet, {}, quiet_camera(), 1);
  double sum = 0, sum_x = 0, sum_y = 0, largest = 0;
  int count = 0;
  for (double x = 0; x <= 640; x += 20) {
    for (double y = 0; y <= 360; y += 20, ++count) {
      const Vec3 eye{panel.x_mm(x), panel.y_mm(y), 400};
      const double d =
          bent.ground_truth_phase(x, y, 1, eye) - straight.ground_truth_phase(x, y, 1, eye);
      sum += d;
      sum_x += d * (x - 320) / 320;
      sum_y += d * (y - 180) / 180;
      largest = std::max(largest, std::abs(d));
    }
  }
  EXPECT_NEAR(sum / count, 0.0, 0.01);
  EXPECT_NEAR(sum_x / count, 0.0, 0.01);
  EXPECT_NEAR(sum_y / count, 0.0, 0.01);
  EXPECT_NEAR(largest, 0.1, 0.01);
}

}  // namespace
}  // namespace lenticule::lab
