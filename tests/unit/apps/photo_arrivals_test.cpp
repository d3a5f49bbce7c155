// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "apps/lenticule-tools/calibrate/hand_held_photos.h"
#include "base/error.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::tools {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class Arrivals : public ::testing::Test {
 protected:
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  [[nodiscard]] std::filesystem::path folder() const { return folder_.path(); }

  test::ScratchFolder folder_;
};

TEST_F(Arrivals, ReportsAPhotographOnceItsSizeStays) {
  PhotoArrivals arrivals(folder());
  write("a.jpg", "ab");
  EXPECT_THAT(arrivals.arrived(), IsEmpty());
  write("a.jpg", "abcd");
  EXPECT_THAT(arrivals.arrived(), IsEmpty()) << "still growing";
  EXPECT_THAT(arrivals.arrived(), ElementsAre(folder() / "a.jpg"));
  EXPECT_THAT(arrivals.arrived(), IsEmpty()) << "once";
}

TEST_F(Arrivals, AreInTheOrderOfTheirNumbers) {
  PhotoArrivals arrivals(folder());
  write("IMG_10.JPG", "a");
  write("IMG_9.JPG", "a");
  EXPECT_THAT(arrivals.arrived(), IsEmpty());
  EXPECT_THAT(arrivals.arrived(), ElementsAre(folder() / "IMG_9.JPG", folder() / "IMG_10.JPG"));
}

TEST_F(Arrivals, OldFilesCountOnlyIfWanted) {
  write("old.jpg", "a");
  PhotoArrivals news(folder()), all(folder(), true);
  EXPECT_THAT(news.arrived(), IsEmpty());
  EXPECT_THAT(news.arrived(), IsEmpty());
  EXPECT_THAT(all.arrived(), IsEmpty());
  EXPECT_THAT(all.arrived(), ElementsAre(folder() / "old.jpg"));
}

TEST_F(Arrivals, OtherFilesDoNotCount) {
  PhotoArrivals arrivals(folder());
  write(".hidden.jpg", "a");
  write("notes.txt", "a");
  write("empty.jpg", "");
  std::filesystem::create_directory(folder() / "folder.jpg");
  EXPECT_THAT(arrivals.arrived(), IsEmpty());
  EXPECT_THAT(arrivals.arrived(), IsEmpty());
}

}  // namespace
}  // namespace lenticule::tools
