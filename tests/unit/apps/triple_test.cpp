// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/triple.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace lenticule::player {
namespace {

TEST(ParseTriple, ReadsThreeNumbers) {
  EXPECT_EQ(parse_triple("--centre", "-1,2.5,3e2"), (Vec3{-1, 2.5, 300}));
}

TEST(ParseTriple, RefusesEverythingElse) {
  for (const char* text : {"", "1", "1,2", "1,2,3,4", "1,2,3 ", "1 2 3", "a,b,c", "1,2,nan",
                           "inf,0,0", "1,,2", ",1,2", "1,2,"})
    EXPECT_THROW((void)parse_triple("--centre", text), Error) << text;
}

}  // namespace
}  // namespace lenticule::player
