// SPDX-License-Identifier: Apache-2.0
// Tests that every row of the table of stress cases passes, and that an unknown row is an error.
#include <nlohmann/json.hpp>

#include "tests/commands/program.h"

namespace lenticule::test {
namespace {

TEST(Stability, EveryRowOfTheQuickTablePasses) {
  const ProcessResult result = run({"bench", "stability", "--quick", "--json"});
  const auto table = nlohmann::json::parse(result.out, nullptr, false);
  ASSERT_TRUE(table.is_object()) << result.err;
  EXPECT_GE(table["rows"].size(), 24U);
  for (const auto& row : table["rows"]) EXPECT_TRUE(row["passes"].get<bool>()) << row.dump(2);
  EXPECT_TRUE(table["passes"].get<bool>());
  EXPECT_EQ(result.exit_code, 0) << result.err;
}

TEST(Stability, PrintsOneRowOnRequest) {
  const ProcessResult result = run({"bench", "stability", "--row", "degenerate"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("pass degenerate"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("1 of 1 rows pass"), std::string::npos) << result.out;
  EXPECT_NE(result.err.find("stability"), std::string::npos) << result.err;
}

TEST(Stability, AnUnknownRowIsAUsageErrorThatListsTheKnownOnes) {
  expect_end(run({"bench", "stability", "--row", "weather"}), 2, "corners");
}

}  // namespace
}  // namespace lenticule::test
