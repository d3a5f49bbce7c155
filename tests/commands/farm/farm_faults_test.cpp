// SPDX-License-Identifier: Apache-2.0
// Tests faults of disks, clocks and folders.
#include <unistd.h>

#include <csignal>
#include <thread>

#include "farm_fixture.h"

namespace lenticule::test {
namespace {

class FarmFaults : public FarmTest {};

TEST_F(FarmFaults, AChunkThatIsTruncatedByHandIsRenderedAgain) {
  plan();
  render_all();
  const std::string file = chunk_file(1);
  std::filesystem::resize_file(file, std::filesystem::file_size(file) - 7);
  EXPECT_EQ(status().at("missing"), "1");
  expect_end(merge(), 4, "1 of 5 chunks are missing: 1");
  ASSERT_EQ(render_chunk(1).exit_code, 0);
  ASSERT_EQ(merge().exit_code, 0);
  EXPECT_EQ(film(), film_of_one_run("0:40"));
}

TEST_F(FarmFaults, AFileThatCannotGrowFailsTheChunkAndTheNextCallSucceeds) {
  plan();
  expect_end(run_process(chunk_words(0), {.largest_file_bytes = 3000}), 1);
  EXPECT_EQ(status().at("chunks_failed"), 1);
  EXPECT_TRUE(std::filesystem::is_empty(work() + "/chunks"));
  render_all();
  EXPECT_EQ(status().at("chunks_failed"), 0);
  ASSERT_EQ(merge().exit_code, 0);
  EXPECT_EQ(film(), film_of_one_run("0:40"));
}

/// Mounts a small file system and fills it.
TEST_F(FarmFaults, AFullDiskFailsTheChunkAndTheNextCallSucceeds) {
  std::filesystem::create_directories(path("small"));
  const std::string script = R"(
set -eu
program=$1 rig=$2 folder=$3
mount -t tmpfs -o size=2m tmpfs "$folder/small" || exit 77
"$program" farm plan builtin:teapot --rig "$rig" --frames 0:40 --chunk 8 --timed-frames 0 \
  -o "$folder/film.lts" --work "$folder/small/work"
"$program" farm render "$folder/small/work" 0
dd if=/dev/zero of="$folder/small/filler" bs=4k 2>/dev/null || true
code=0
"$program" farm render "$folder/small/work" 1 2>"$folder/errors" || code=$?
[ "$code" = 1 ] || exit 3
grep -q 'No space left on device' "$folder/errors" || exit 4
"$program" farm status "$folder/small/work" --json >"$folder/status.json"
rm "$folder/small/filler"
sh "$folder/small/work/commands.txt"
"$program" farm merge "$folder/small/work"
)";
  const ProcessResult result =
      run_process({"/usr/bin/unshare", geteuid() == 0 ? "-m" : "-rm", "/bin/sh", "-c", script, "sh",
                   LENTICULE_PROGRAM, rig_, folder_.string()});
  if (result.exit_code == 77 || (result.exit_code == 1 && result.err.find("unshare") == 0))
    GTEST_SKIP() << "this system lets no user mount: " << result.err;
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(json::parse(std::ifstream(path("status.json"))).at("chunks_done"), 1);
  EXPECT_EQ(film(), film_of_one_run("0:40"));
}

TEST_F(FarmFaults, ANodeWhoseClockIsTenMinutesLateChangesNothing) {
  plan();
  std::vector<std::string> late = {"/usr/bin/env", std::string("LD_PRELOAD=") + FARM_CLOCK_OFF};
  const auto with_late_clock = [&](const std::vector<std::string>& words) {
    const std::vector<std::string> all = joined(late, words);
    return all;
  };
  ASSERT_EQ(run_process(with_late_clock({"/bin/date", "+%s"})).exit_code, 0);
  const long shown = std::stol(run_process(with_late_clock({"/bin/date", "+%s"})).out);
  EXPECT_NEAR(static_cast<double>(shown), static_cast<double>(time(nullptr) - 600), 20.0);
  for (const uint64_t chunk : {0U, 2U, 4U})
    ASSERT_EQ(run_process(with_late_clock(chunk_words(chunk))).exit_code, 0);
  ASSERT_EQ(render_chunk(1).exit_code, 0);
  const json here = status();
  EXPECT_EQ(here.at("chunks_done"), 4);
  EXPECT_GT(here.at("frames_per_second"), 0.0);
  // The status is the same on the node, whose clock says that the chunks will be done later.
  const ProcessResult there =
      run_process(with_late_clock(program({"farm", "status", work(), "--json"})));
  ASSERT_EQ(there.exit_code, 0) << there.err;
  EXPECT_EQ(json::parse(there.out).at("chunks_done"), 4);
  EXPECT_GT(json::parse(there.out).at("frames_per_second"), 0.0);
  BackgroundProcess running(with_late_clock(chunk_words(3)));
  ASSERT_EQ(running.wait(std::chrono::seconds(300)).exit_code, 0);
  ASSERT_EQ(merge().exit_code, 0);
  EXPECT_EQ(film(), film_of_one_run("0:40"));
}

/// Returns the words that run a program on a folder which shows files of others two seconds late,
/// and takes opened files away.
std::vector<std::string> on_network_folder(const std::vector<std::string>& words) {
  const std::vector<std::string> all =
      joined({"/usr/bin/env", std::string("LD_PRELOAD=") + FARM_NETWORK_FOLDER, "FARM_LATE_MS=2000",
              "FARM_STALE=1"},
             words);
  return all;
}

TEST_F(FarmFaults, AFolderThatShowsFilesLateAndTakesOpenedFilesAwayMakesTheFilm) {
  plan("0:40", "5");
  // The layer does what it says: a new file is not there, and is later.
  const std::string report = work() + "/reports/none.json";
  const auto is_shown = [&] {
    return run_process(on_network_folder({"/bin/cat", report})).exit_code == 0;
  };
  std::ofstream(report).flush();
  EXPECT_FALSE(is_shown());
  std::this_thread::sleep_for(std::chrono::milliseconds(2100));
  EXPECT_TRUE(is_shown());
  std::filesystem::remove(report);
  // Two processes for each chunk, which see each other's files late; the last chunks first.
  for (uint64_t chunk = chunks(); chunk-- > 0;) {
    BackgroundProcess first(on_network_folder(chunk_words(chunk)));
    BackgroundProcess second(on_network_folder(chunk_words(chunk)));
    EXPECT_EQ(first.wait(std::chrono::seconds(300)).exit_code, 0);
    EXPECT_EQ(second.wait(std::chrono::seconds(300)).exit_code, 0);
  }
  expect_end(run_process(on_network_folder(program({"farm", "merge", work(), "--wait", "60"}))), 0);
  EXPECT_EQ(film(), film_of_one_run("0:40"));
  EXPECT_EQ(status().at("complete"), true);
  EXPECT_TRUE(status().at("differing").empty());
}

TEST_F(FarmFaults, TwoMergesAtOnceMakeTheFilm) {
  plan();
  render_all();
  const std::vector<uint8_t> expected = film_of_one_run("0:40");
  for (int trial = 0; trial < 3; ++trial) {
    BackgroundProcess first(program({"farm", "merge", work()}));
    BackgroundProcess second(program({"farm", "merge", work()}));
    EXPECT_EQ(first.wait(std::chrono::seconds(300)).exit_code, 0);
    EXPECT_EQ(second.wait(std::chrono::seconds(300)).exit_code, 0);
    EXPECT_EQ(film(), expected);
  }
  // No temporary file stays beside the film.
  for (const std::string& name : listing())
    EXPECT_EQ(name.find("unfinished"), std::string::npos) << name;
}

/// An orphan and the process that replaces it.
TEST_F(FarmFaults, TwoProcessesOfTheSameChunkDoNoHarm) {
  plan();
  for (uint64_t chunk = 0; chunk < chunks(); ++chunk) {
    BackgroundProcess first(chunk_words(chunk));
    std::this_thread::sleep_for(std::chrono::milliseconds(70 * chunk));
    BackgroundProcess second(chunk_words(chunk));
    EXPECT_EQ(first.wait(std::chrono::seconds(300)).exit_code, 0);
    EXPECT_EQ(second.wait(std::chrono::seconds(300)).exit_code, 0);
  }
  EXPECT_EQ(status().at("chunks_done"), 5);
  EXPECT_TRUE(status().at("differing").empty());
  ASSERT_EQ(merge().exit_code, 0);
  EXPECT_EQ(film(), film_of_one_run("0:40"));
}

TEST_F(FarmFaults, AnInterruptedProcessLeavesNothingAndIsNoFailure) {
  plan("0:2000", "2000");
  expect_end(run_process(chunk_words(0), {.interrupt_signal = SIGTERM,
                                          .interrupt_after = std::chrono::milliseconds(1500)}),
             143);
  EXPECT_EQ(status().at("chunks_failed"), 0);
  EXPECT_EQ(status().at("chunks_missing"), 1);
  EXPECT_TRUE(std::filesystem::is_empty(work() + "/attempts/000000"));
}

}  // namespace
}  // namespace lenticule::test
