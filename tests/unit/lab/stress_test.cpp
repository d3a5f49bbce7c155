// SPDX-License-Identifier: Apache-2.0
// Runs every stress case of calibration at small size; `lenticule bench calibrate --stress --full`
// runs them at the size of real panels.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <ostream>
#include <set>

#include "lab/panel/stress_cases.h"

namespace lenticule::lab {

/// Prints the name, since GoogleTest would print bytes.
static void PrintTo(const StressCase& one, std::ostream* out) { *out << one.name; }

namespace {

class Stress : public testing::TestWithParam<StressCase> {};

std::string figures_of(const StressOutcome& outcome, const StressLimits& limits) {
  return fmt::format(
      "{}: flat {:.5f} of {:.3f}, worst {:.5f} of {:.3f}, pitch {:.2e} of {:.2e}, map {:.5f} of "
      "{:.3f}; {}",
      outcome.verdict, outcome.flat_lenses, limits.flat_lenses, outcome.errors.worst_lenses,
      limits.worst_lenses, outcome.pitch, limits.pitch, outcome.errors.map_rms_lenses,
      limits.map_rms_lenses, outcome.said);
}

std::string name_of(const testing::TestParamInfo<StressCase>& one) {
  std::string name = one.param.name;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

TEST_P(Stress, MeetsItsRequirement) {
  const StressOutcome outcome = run_stress_case(GetParam(), StressSize::Small, {});
  const std::string figures = figures_of(outcome, limits_at(GetParam(), StressSize::Small));
  EXPECT_FALSE(outcome.wrong) << figures;
  // A known shortfall is recorded in the table and must be removed from it once the case passes.
  EXPECT_EQ(outcome.held, GetParam().shortfall.empty()) << figures;
}

INSTANTIATE_TEST_SUITE_P(Cases, Stress, testing::ValuesIn(stress_cases()), name_of);

TEST(StressCases, CoverEveryRowOfTheTableWithUniqueNames) {
  std::set<std::string> names;
  std::set<int> rows;
  for (const StressCase& one : stress_cases()) {
    names.insert(one.name);
    rows.insert(one.row);
  }
  EXPECT_EQ(names.size(), stress_cases().size());
  EXPECT_EQ(rows.size(), 24U);
  EXPECT_EQ(*rows.begin(), 1);
  EXPECT_EQ(*rows.rbegin(), 24);
}

}  // namespace
}  // namespace lenticule::lab
