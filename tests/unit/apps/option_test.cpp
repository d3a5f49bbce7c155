// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/option.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "tests/support/error_matchers.h"

namespace lenticule::cli {
namespace {

TEST(ParseTriple, ReadsThreeNumbers) {
  EXPECT_EQ(parse_triple("--centre", "-1,2.5,3e2"), (Vec3{-1, 2.5, 300}));
}

TEST(ParseTriple, RefusesEverythingElse) {
  for (const char* text : {"", "1", "1,2", "1,2,3,4", "1,2,3 ", "1 2 3", "a,b,c", "1,2,nan",
                           "inf,0,0", "1,,2", ",1,2", "1,2,"})
    EXPECT_THROW((void)parse_triple("--centre", text), Error) << text;
}

TEST(AddTriple, HelpShowsTheTypeAndWrongValuesAreErrorsOfTheCommandLine) {
  CLI::App app;
  Vec3 centre{};
  add_triple(
      app, "--centre X,Y,Z", [&](Vec3 at) { centre = at; }, "a point");
  EXPECT_THAT(app.help(), ::testing::HasSubstr("--centre X,Y,Z"));
  app.parse("--centre -1,2.5,3");
  EXPECT_EQ(centre, (Vec3{-1, 2.5, 3}));
  const Error error = test::error_of([&] { app.parse("--centre 1,2"); });
  EXPECT_EQ(error.kind(), ErrorKind::Usage);
  EXPECT_STREQ(error.what(), "--centre '1,2': not three numbers");
}

}  // namespace
}  // namespace lenticule::cli
