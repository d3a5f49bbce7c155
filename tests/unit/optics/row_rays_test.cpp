// SPDX-License-Identifier: Apache-2.0
#include "optics/row_rays.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "base/error.h"
#include "tests/support/allocation_count.h"
#include "tests/support/random_rigs.h"

namespace lenticule::optics {
namespace {

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

bool same_bits(const RowRays& a, const RowRays& b) {
  return same_bits(a.lens_x_mm, b.lens_x_mm) && same_bits(a.lens_y_mm, b.lens_y_mm) &&
         same_bits(a.tan_x, b.tan_x) && same_bits(a.tan_y, b.tan_y) && same_bits(a.lens, b.lens) &&
         same_bits(a.place, b.place);
}

/// A set that the machine lacks is replaced by the best below it.
TEST(RowRays, AreTheSameBitsForEveryInstructionSet) {
  std::mt19937_64 random(77);
  for (int r = 0; r < 60; ++r) {
    const OpticalModel model(test::random_rig(random));
    const Panel& panel = model.rig().panel;
    const int j = static_cast<int>(random() % static_cast<uint64_t>(panel.height_px));
    const Eye eye{50.0, 20.0, 640.0};
    RowRays baseline, other;
    std::vector<double> phase, other_phase;
    RowRayEvaluator(model, Isa::Baseline).evaluate(j, 0, panel.width_px, baseline);
    RowPhaseEvaluator(model, eye, Isa::Baseline).evaluate(j, 0, panel.width_px, phase);
    for (const Isa isa : {Isa::Avx2, Isa::Avx512}) {
      RowRayEvaluator(model, isa).evaluate(j, 0, panel.width_px, other);
      ASSERT_TRUE(same_bits(baseline, other)) << isa_name(isa) << " rig " << r;
      RowPhaseEvaluator(model, eye, isa).evaluate(j, 0, panel.width_px, other_phase);
      ASSERT_TRUE(same_bits(phase, other_phase)) << isa_name(isa) << " rig " << r;
    }
  }
}

TEST(RowRays, DoNotDependOnHowARowIsDivided) {
  std::mt19937_64 random(78);
  for (int r = 0; r < 40; ++r) {
    const OpticalModel model(test::random_rig(random));
    const RowRayEvaluator evaluator(model);
    const int width = model.rig().panel.width_px, j = model.rig().panel.height_px / 3;
    RowRays whole, part;
    evaluator.evaluate(j, 0, width, whole);
    const int begin = width / 7, end = width - width / 5;
    evaluator.evaluate(j, begin, end, part);
    ASSERT_EQ(part.size(), static_cast<size_t>(3 * (end - begin)));
    for (size_t s = 0; s < part.size(); ++s) {
      const size_t at = s + 3 * static_cast<size_t>(begin);
      ASSERT_EQ(part.tan_x[s], whole.tan_x[at]);
      ASSERT_EQ(part.lens_x_mm[s], whole.lens_x_mm[at]);
      ASSERT_EQ(part.place[s], whole.place[at]);
      ASSERT_EQ(part.lens[s], whole.lens[at]);
    }
  }
}

TEST(RowRays, DoNotAllocateOnceTheyHaveTheirSize) {
  Rig rig = test::kiosk_rig();
  std::mt19937_64 random(79);
  rig.sheet.residual = test::random_residual(random, 11, 7, 0.1);
  const OpticalModel model(rig);
  const RowRayEvaluator evaluator(model);
  RowRays rays;
  rays.resize(3 * 3840);
  const double* const where = rays.place.data();
  const long before = allocations.load();
  for (int j = 0; j < 10; ++j) evaluator.evaluate(j, 0, 3840, rays);
  EXPECT_EQ(rays.place.data(), where);
  if (LENTICULE_COUNTS_ALLOCATIONS) {
    EXPECT_EQ(allocations.load(), before);
  }
}

TEST(RowPhases, AgreeWithTheModel) {
  std::mt19937_64 random(80);
  std::vector<double> phase;
  for (int r = 0; r < 60; ++r) {
    const OpticalModel model(test::random_rig(random));
    const Panel& panel = model.rig().panel;
    const Eye eye{-180.0, 90.0, 500.0};
    const int j = panel.height_px - 1, end = std::min(panel.width_px, 300);
    RowPhaseEvaluator(model, eye).evaluate(j, 0, end, phase);
    for (int s = 0; s < 3 * end; ++s) {
      const Vec2 q = panel.subpixel_centre_px(s / 3, j, s % 3);
      ASSERT_NEAR(phase[static_cast<size_t>(s)], model.phase(q.x, q.y, s % 3, eye), 1e-9);
    }
  }
}

/// Sets LENTICULE_ISA and restores the old value at the end.
class ForcedIsa {
 public:
  explicit ForcedIsa(const char* forced) {
    if (const char* old = std::getenv("LENTICULE_ISA")) old_ = old;
    ::setenv("LENTICULE_ISA", forced, 1);
  }
  ~ForcedIsa() {
    old_.empty() ? ::unsetenv("LENTICULE_ISA") : ::setenv("LENTICULE_ISA", old_.c_str(), 1);
  }

 private:
  std::string old_;
};

TEST(RowPhases, AgreeWithTheModelCloseToTheSheet) {
  Rig rig = test::kiosk_rig();
  rig.sheet.channel_offset = {Subpixels(0.1), Subpixels(-0.2), Subpixels(0.3)};
  const OpticalModel model(rig);
  for (const double z_mm : {3.0, 1.0, 0.1, 1e-6}) {
    const Eye eye{30.0, -20.0, z_mm};
    const RowPhaseEvaluator evaluator(model, eye);
    std::vector<double> row;
    evaluator.evaluate(700, 1000, 1100, row);
    for (int s = 3000; s < 3300; ++s) {
      const Vec2 at = rig.panel.subpixel_centre_px(s / 3, 700, s % 3);
      const double phase = model.phase(at.x, at.y, s % 3, eye);
      ASSERT_NEAR(row[static_cast<size_t>(s - 3000)], phase, 1e-9) << z_mm;
      // A panel point without the colour's offset is the apparent place of that colour.
      const double x = at.x + rig.sheet.channel_offset[static_cast<size_t>(s % 3)].value / 3.0;
      double alone = 0.0;
      evaluator.evaluate_points({&x, 1}, {&at.y, 1}, {&alone, 1});
      const Vec2 lens = model.lens_point_mm({rig.panel.x_mm(x), rig.panel.y_mm(at.y)}, eye);
      const double from_centre =
          (rig.panel.x_px(lens.x) - rig.panel.width_px / 2.0) +
          rig.sheet.slant * (rig.panel.y_px(lens.y) - rig.panel.height_px / 2.0);
      ASSERT_NEAR(alone, 3.0 * from_centre / rig.sheet.pitch.value + rig.sheet.offset.value, 1e-9);
    }
  }
}

TEST(BestIsa, IsASetOfThisMachineForEveryName) {
  for (const char* name : {"baseline", "neon", "avx2", "avx512"}) {
    const ForcedIsa forced(name);
    EXPECT_TRUE(isa_supported(best_isa())) << name;
  }
}

TEST(BestIsa, RefusesUnknownNames) {
  const ForcedIsa forced("avx1024");
  EXPECT_THROW((void)best_isa(), Error);
}

TEST(SelectKernel, ReturnsTheRequestedKernelOrTheBestSupportedBelowIt) {
  const int baseline = 0, avx2 = 1, avx512 = 2;
  const auto selected = [&](Isa isa) { return select_kernel(isa, baseline, avx2, avx512); };
  const int best = isa_supported(Isa::Avx512) ? avx512 : isa_supported(Isa::Avx2) ? avx2 : baseline;
  EXPECT_EQ(selected(Isa::Baseline), baseline);
  EXPECT_EQ(selected(Isa::Avx2), std::min(avx2, best));
  EXPECT_EQ(selected(Isa::Avx512), best);
}

TEST(SelectKernel, ReturnsTheNeonKernelOnlyWhereNeonIs) {
  const int baseline = 0, neon = 1;
  EXPECT_EQ(select_kernel(Isa::Baseline, baseline, neon), baseline);
  EXPECT_EQ(select_kernel(Isa::Neon, baseline, neon), isa_supported(Isa::Neon) ? neon : baseline);
}

}  // namespace
}  // namespace lenticule::optics
