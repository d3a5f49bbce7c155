// SPDX-License-Identifier: Apache-2.0
// Tests properties of swept rows: closed meshes have no holes, and a row is the same however it is
// computed.
#include <gtest/gtest.h>

#include <map>
#include <utility>

#include "render/row_sweep/row_sweep.h"
#include "tests/support/allocation_count.h"
#include "tests/support/oracles/visibility_oracle.h"
#include "tests/unit/render/row_sweep_scenes.h"

namespace lenticule::render {
namespace {

TEST(RowSweep, LeavesNoHolesInClosedMeshes) {
  // Corners and edges lie exactly on rays: the grid's corners are the rays' points in the panel's
  // plane.
  const optics::Rig rig = test::make_rig({.pitch_subpx = 9.0, .slant = 0.0});
  const optics::OpticalModel model(rig);
  TriangleMesh grid;
  constexpr uint32_t kAcross = 36, kDown = 8;
  for (uint32_t j = 0; j < kDown; ++j)
    for (uint32_t s = 0; s < kAcross; ++s) {
      const auto ray =
          model.ray(static_cast<int>(s) / 3, static_cast<int>(j), static_cast<int>(s % 3));
      const double z = -40.0;
      grid.positions.push_back({ray.lens_x_mm + z * ray.tan_x, ray.lens_y_mm + z * ray.tan_y, z});
    }
  for (uint32_t j = 0; j + 1 < kDown; ++j)
    for (uint32_t s = 0; s + 1 < kAcross; ++s) {
      const uint32_t a = j * kAcross + s;
      grid.triangles.push_back({a, a + 1, a + kAcross});
      grid.triangles.push_back({a + 1, a + kAcross + 1, a + kAcross});
    }
  const Scene scene(scene_of({grid}), plain_stage(), {}, 1);
  const RowPlanes planes(model);
  const RowSweep sweep(planes, scene);
  RowSweep::Worker worker(sweep);
  SweptRow row;
  for (int j = 1; j + 1 < static_cast<int>(kDown); ++j) {
    worker.sweep(j, row);
    for (size_t s = 9; s < kAcross - 9; ++s) EXPECT_NE(row.cut[s], SweptRow::kNothing) << j << s;
  }
}

/// Cuts of two triangles that share an edge end in the same bits, so that no ray passes between
/// them: the cut of a closed mesh is closed.
TEST(RowSweep, CutsOfClosedMeshesAreClosed) {
  const optics::OpticalModel model(test::make_rig({.height = 300, .pixel_mm = 0.2}));
  const Scene scene(scene_of({test::ball_mesh({0.1, 0.2, 0.3}, 60.0, 60, 0)}),
                    test::make_tiny_stage({.mm_per_unit = 1.0, .turn_degrees = 11.0}), {}, 1);
  const RowPlanes planes(model);
  const SweepPrimitives primitives(scene, planes, scene.near_mm + 1.0);
  PlaneCuts cuts;
  std::vector<SweptCut> numbers;
  for (int j = 0; j < 300; ++j) {
    primitives.cut(j, planes.plane_of(j, 0), cuts, numbers);
    std::map<std::pair<float, float>, int> ends;
    for (const sweep_kernel::Segment& cut : cuts.segments)
      ++ends[{cut.x0, cut.z0}], ++ends[{cut.x1, cut.z1}];
    EXPECT_GT(ends.size(), 100U);
    for (const auto& [end, count] : ends) ASSERT_EQ(count % 2, 0) << j;
  }
}

TEST(RowSweep, GivesTheSameBitsOnEveryInstructionSet) {
  for (const NamedRig& rig : tiny_rigs())
    for (const test::NamedScene& named : test::tiny_scenes()) {
      const optics::OpticalModel model(rig.rig);
      const Scene scene(named.scene, test::make_tiny_stage({.turn_degrees = 7.0}), {}, 1);
      const RowPlanes best(model, Isa::Baseline);
      const RowSweep sweep(best, scene);
      RowSweep::Worker worker(sweep);
      for (const Isa isa : {Isa::Avx2, Isa::Avx512}) {
        const RowPlanes planes(model, isa);
        const RowSweep other_sweep(planes, scene);
        RowSweep::Worker other_worker(other_sweep);
        SweptRow row, other;
        for (int j = 0; j < rig.rig.panel.height_px; ++j) {
          worker.sweep(j, row);
          other_worker.sweep(j, other);
          for (size_t s = 0; s < best.row_subpixels(); ++s) {
            ASSERT_EQ(row.cut[s], other.cut[s]) << rig.name << " " << named.name << " " << j;
            ASSERT_EQ(row.z_mm[s], other.z_mm[s]);
          }
        }
      }
    }
}

TEST(RowSweep, AllocatesNothingAfterTheFirstFrame) {
  for (const NamedRig& rig : tiny_rigs()) {
    const optics::OpticalModel model(rig.rig);
    const Scene scene(test::tiny_scenes().front().scene, test::make_tiny_stage(), {}, 1);
    const RowPlanes planes(model);
    const RowSweep sweep(planes, scene);
    RowSweep::Worker worker(sweep);
    SweptRow row;
    const auto all = [&] {
      for (int j = 0; j < rig.rig.panel.height_px; ++j) worker.sweep(j, row);
    };
    all();
    const long before = allocations.load();
    all();
    EXPECT_EQ(allocations.load(), before) << rig.name;
  }
}

}  // namespace
}  // namespace lenticule::render
