// SPDX-License-Identifier: Apache-2.0
// Tests `lenticule farm` for a panel of a wall.
#include <fmt/format.h>

#include "farm_fixture.h"

namespace lenticule::test {
namespace {

class FarmWall : public FarmTest {
 protected:
  void SetUp() override {
    FarmTest::SetUp();
    write_wall(-12.5);
  }

  void write_wall(double left_mm) const {
    write("wall.toml", fmt::format(R"(format = 1
viewer_mm = [0, 0, 500]
[[panel]]
name = "left"
rig = "{0}"
centre_mm = [{1}, 0, 0]
[[panel]]
name = "right"
rig = "{0}"
centre_mm = [12.5, 0, 0]
turn_degrees = -3
)",
                                   rig_, left_mm));
  }

  [[nodiscard]] ProcessResult plan_panel(const std::vector<std::string>& more) const {
    return run(joined(
        {"farm", "plan", "builtin:teapot", "--wall", path("wall.toml"), "--fit", "--frames", "0:12",
         "--chunk", "5", "--timed-frames", "1", "-o", path("film.lts"), "--work", work()},
        more));
  }
};

TEST_F(FarmWall, TheFilmOfAPanelHasTheBytesOfOneRun) {
  expect_end(plan_panel({"--panel", "right"}), 0);
  render_all();
  ASSERT_EQ(merge().exit_code, 0);
  const ProcessResult whole =
      run({"render", "builtin:teapot", "--wall", path("wall.toml"), "--panel", "right", "--fit",
           "--frames", "0:12", "-o", path("whole.lts")});
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  EXPECT_EQ(film(), read_bytes(path("whole-right.lts")));
}

TEST_F(FarmWall, WithoutTheNameOfAPanelThePlanIsRefused) {
  expect_end(plan_panel({}), 2, "--panel NAME");
}

/// The scene is placed on the rectangle around all panels.
TEST_F(FarmWall, AChunkIsRefusedAfterAnotherPanelWasMoved) {
  ASSERT_EQ(plan_panel({"--panel", "right"}).exit_code, 0);
  write_wall(-13.0);
  expect_end(render_chunk(0), 4, "the wall is not the one of the plan");
}

}  // namespace
}  // namespace lenticule::test
