// SPDX-License-Identifier: Apache-2.0
// Tests that engines other than Slurm run the list of commands.
#include "farm_fixture.h"

namespace lenticule::test {
namespace {

class FarmEngines : public FarmTest {
 protected:
  /// Runs a shell script; "$1" is the work folder.
  [[nodiscard]] ProcessResult shell(const std::string& script) const {
    return run_process({"/bin/sh", "-c", script, "sh", work()});
  }
  void expect_the_film() const {
    ASSERT_EQ(merge().exit_code, 0);
    EXPECT_EQ(film(), film_of_one_run("0:24"));
  }
};

TEST_F(FarmEngines, AShellRunsTheList) {
  plan("0:24", "5");
  ASSERT_EQ(shell("sh \"$1/commands.txt\"").exit_code, 0);
  expect_the_film();
}

TEST_F(FarmEngines, XargsRunsTheListInParallel) {
  plan("0:24", "5");
  expect_end(shell("shuf \"$1/commands.txt\" | tr '\\n' '\\0' | xargs -0 -n 1 -P 3 sh -c"), 0);
  expect_the_film();
}

TEST_F(FarmEngines, GnuParallelRunsTheList) {
  if (!std::filesystem::exists("/usr/bin/parallel"))
    GTEST_SKIP() << "GNU parallel is not installed: scripts/packages farm";
  plan("0:24", "5");
  expect_end(shell("parallel --will-cite --jobs 2 --joblog \"$1/log\" <\"$1/commands.txt\""), 0);
  expect_the_film();
}

/// The habit of Blender's users: the number of the array's task is the number of the frame.
TEST_F(FarmEngines, RenderTakesTheNumberOfAnArraysTaskAsTheFrame) {
  expect_end(
      run_process(
          {"/bin/sh", "-c",
           "for SLURM_ARRAY_TASK_ID in 4 5; do \"$1\" render builtin:teapot --rig \"$2\" --frames "
           "$SLURM_ARRAY_TASK_ID -o \"$3/%03d.png\"; done",
           "sh", LENTICULE_PROGRAM, rig_, folder_.string()}),
      0);
  EXPECT_EQ(listing(), (std::vector<std::string>{"004.png", "005.png"}));
}

}  // namespace
}  // namespace lenticule::test
