// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "frames/image_io.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::frames {
namespace {

using test::error_of;
using ::testing::ElementsAre;

TEST(FilePattern, PadsLikePrintf) {
  EXPECT_EQ(FilePattern("out/%05d.png").path(7), "out/00007.png");
  EXPECT_EQ(FilePattern("out/%05d.png").path(123456), "out/123456.png");
  EXPECT_EQ(FilePattern("%d").path(0), "0");
  EXPECT_EQ(FilePattern("a%03db.tif").path(12), "a012b.tif");
}

TEST(FilePattern, RefusesPatternsWithoutExactlyOneNumber) {
  for (const char* text : {"plain.png", "%s.png", "%5d.png", "%d%d.png", "%d/a.png", "%", "%0",
                           "50%", "%-3d.png", "%099d.png", "%ld.png", "%d%%.png", "%00000d.png"})
    EXPECT_EQ(error_of([&] { FilePattern pattern(text); }).kind(), ErrorKind::Usage) << text;
}

TEST(FilePattern, DistinguishesPatternsFromNames) {
  EXPECT_TRUE(FilePattern::looks_like_pattern("a/%05d.png"));
  EXPECT_FALSE(FilePattern::looks_like_pattern("a/00001.png"));
}

TEST(FilePattern, FindsExactlyItsFiles) {
  const test::ScratchFolder folder;
  for (const char* name :
       {"f0010.png", "f0002.png", "f2.png", "f10000.png", "g0001.png", "f0003.tif", "f0004.png.tmp",
        "f-001.png", "f.png", "f00x1.png", "f99999999999999999999.png"})
    test::write_bytes(folder / name, {1});
  EXPECT_THAT(FilePattern((folder / "f%04d.png").string()).existing(), ElementsAre(2, 10, 10000));
  EXPECT_THAT(FilePattern((folder / "f%d.png").string()).existing(), ElementsAre(2, 10000));
  EXPECT_TRUE(FilePattern((folder / "none/%d.png").string()).existing().empty());
}

}  // namespace
}  // namespace lenticule::frames
