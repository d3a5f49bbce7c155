// SPDX-License-Identifier: Apache-2.0
// Tests the commands of `lenticule farm` from the plan to the film.
#include <unistd.h>

#include <csignal>

#include "farm_fixture.h"

namespace lenticule::test {
namespace {

class FarmCommand : public FarmTest {};

TEST_F(FarmCommand, TheMergedFilmHasTheBytesOfOneRun) {
  plan("3:63", "9");
  render_all();
  ASSERT_EQ(merge().exit_code, 0);
  EXPECT_EQ(film(), film_of_one_run("3:63"));
}

/// Frames that depend on earlier ones, on the length of the film, and on flags.
TEST_F(FarmCommand, MethodsThatReuseFramesGiveTheBytesOfOneRun) {
  for (const std::vector<std::string>& flags : std::vector<std::vector<std::string>>{
           {"--method", "temporal"},
           {"--method", "adaptive", "--turn", "-10:350", "--background", "0.1,0.2,0.3"},
           {"--method", "hybrid", "--fps", "24000/1001"}}) {
    std::filesystem::remove_all(work());
    plan("5:45", "9", flags);
    for (uint64_t chunk = chunks(); chunk-- > 0;) ASSERT_EQ(render_chunk(chunk).exit_code, 0);
    ASSERT_EQ(merge({"--overwrite"}).exit_code, 0);
    EXPECT_EQ(film(), film_of_one_run("5:45", flags)) << flags[1];
  }
}

/// A chunk commits the scene of its only frame, and one run keeps parts of it.
TEST_F(FarmCommand, SingleFramesOfTurningScenesHaveTheBytesOfOneRun) {
  for (const std::string& scene :
       {source_file("tests/data/textured-quad.gltf"), std::string("builtin:teapot:2"),
        std::string("builtin:balls:2")}) {
    for (const std::string& made : {work(), path("film.lts"), path("whole.lts")})
      std::filesystem::remove_all(made);
    const std::vector<std::string> words = {scene, "--rig", rig_,     "--frames",
                                            "0:6", "--fit", "--turn", "0:50"};
    expect_end(
        run(joined(joined({"farm", "plan"}, words), {"--chunk", "1", "--timed-frames", "0", "-o",
                                                     path("film.lts"), "--work", work()})),
        0);
    render_all();
    ASSERT_EQ(merge().exit_code, 0);
    expect_end(run(joined(joined({"render"}, words), {"-o", path("whole.lts")})), 0);
    EXPECT_EQ(film(), read_bytes(path("whole.lts"))) << scene;
  }
}

TEST_F(FarmCommand, NumberedScenesAndRelativeNamesWorkFromAnyFolder) {
  std::filesystem::create_directories(path("it's a scene"));
  for (int frame = 0; frame < 12; ++frame)
    ASSERT_EQ(run({"scene", "demo", "--frame", std::to_string(frame), "-o",
                   path("it's a scene/demo-" + std::to_string(frame) + ".nff")})
                  .exit_code,
              0);
  std::filesystem::copy_file(rig_, path("rig.toml"));
  const auto shell = [&](const std::string& script) {
    return run_process(
        {"/bin/sh", "-c", "cd \"$2\" && " + script, "sh", LENTICULE_PROGRAM, folder_.string()});
  };
  expect_end(
      shell("\"$1\" farm plan \"it's a scene/demo-%d.nff\" --rig rig.toml --frames 0:12 --chunk 5 "
            "--timed-frames 1 -o film.lts --work 'w o;rk'"),
      0);
  expect_end(shell("cd / && sh \"$2/w o;rk/commands.txt\""), 0);
  ASSERT_EQ(shell("\"$1\" farm merge 'w o;rk'").exit_code, 0);
  ASSERT_EQ(shell("\"$1\" render \"it's a scene/demo-%d.nff\" --rig rig.toml --frames 0:12 "
                  "-o whole.lts")
                .exit_code,
            0);
  EXPECT_EQ(film(), read_bytes(path("whole.lts")));
}

TEST_F(FarmCommand, AScenePictureOrRigThatChangesAfterThePlanIsRefused) {
  ASSERT_EQ(run({"scene", "teapot", "-o", path("scene.nff")}).exit_code, 0);
  std::filesystem::copy_file(rig_, path("rig.toml"));
  expect_end(run({"farm", "plan", path("scene.nff"), "--rig", path("rig.toml"), "--frames", "0:4",
                  "--chunk", "2", "--timed-frames", "0", "-o", path("film.lts"), "--work", work()}),
             0);
  ASSERT_EQ(render_chunk(0).exit_code, 0);
  ASSERT_EQ(run({"rig", "trim", path("rig.toml"), "--offset-by", "0.01"}).exit_code, 0);
  expect_end(render_chunk(1), 4, "the rig is not the one of the plan");
  EXPECT_EQ(status().at("chunks_failed"), 1);
  ASSERT_EQ(run({"rig", "trim", path("rig.toml"), "--reset"}).exit_code, 0);
  ASSERT_EQ(run({"scene", "gears", "--size", "1", "-o", path("scene.nff")}).exit_code, 0);
  expect_end(render_chunk(1), 4, "the scene is not the one of the plan");
}

TEST_F(FarmCommand, PlanningAgainKeepsThePlanAndAnotherFilmIsRefused) {
  plan();
  ASSERT_EQ(render_chunk(0).exit_code, 0);
  plan();
  EXPECT_EQ(status().at("chunks_done"), 1);
  EXPECT_EQ(run(plan_words("0:41", "8")).exit_code, 4);
  EXPECT_EQ(run(plan_words("0:40", "0")).exit_code, 2);
  EXPECT_EQ(run({"farm", "render", work(), "5"}).exit_code, 2);
  EXPECT_EQ(run({"farm", "status", path("none")}).exit_code, 4);
  EXPECT_EQ(run({"farm", "submit", work()}).exit_code, 2);
}

TEST_F(FarmCommand, AutomaticChunksAreChosenFromTimedFrames) {
  const json planned = results_of(run(plan_words("0:40", "auto", {"--json"})));
  EXPECT_GT(planned.at("frame_seconds"), 0.0);
  EXPECT_EQ(planned.at("chunks"), 1) << "40 small frames take no minutes";
  EXPECT_EQ(run(plan_words("0:40", "auto", {"--timed-frames", "0"})).exit_code, 2);
}

TEST_F(FarmCommand, StatusCountsAndAPartialFilmEndsBeforeTheFirstMissingChunk) {
  plan();
  for (const uint64_t chunk : {0U, 1U, 3U}) ASSERT_EQ(render_chunk(chunk).exit_code, 0);
  const json now = status();
  EXPECT_EQ(now.at("chunks_done"), 3);
  EXPECT_EQ(now.at("frames_done"), 24);
  EXPECT_EQ(now.at("missing"), "2,4");
  EXPECT_EQ(now.at("complete"), false);
  EXPECT_EQ(merge().exit_code, 4);
  ASSERT_EQ(merge({"--partial", "-o", path("begin.lts")}).exit_code, 0);
  EXPECT_EQ(read_bytes(path("begin.lts")), film_of_one_run("0:16"));
}

TEST_F(FarmCommand, VerifyNamesTheNodeWhoseFramesDiffer) {
  plan();
  render_all();
  const auto verify = [&] {
    return run({"farm", "verify", work(), "--sample", "40", "--seed", "1", "--json"});
  };
  EXPECT_EQ(verify().exit_code, 0);
  // A node that renders otherwise: chunk 2 is made from another film.
  const json report = json::parse(std::ifstream(work() + "/reports/000002.json"));
  ASSERT_EQ(run({"render", "builtin:gears:1", "--rig", rig_, "--frames", "16:24", "-o",
                 path("other.lts")})
                .exit_code,
            0);
  std::filesystem::copy_file(path("other.lts"), chunk_file(2),
                             std::filesystem::copy_options::overwrite_existing);
  json faulty = report;
  faulty["node"] = "node-with-a-fault";
  faulty["bytes"] = std::filesystem::file_size(chunk_file(2));
  std::ofstream(work() + "/reports/000002.json") << faulty.dump();
  const ProcessResult found = verify();
  EXPECT_EQ(found.exit_code, 5);
  const json differences = json::parse(found.out).at("differences");
  ASSERT_EQ(differences.size(), 8U) << found.out;
  for (const json& one : differences) {
    EXPECT_EQ(one.at("node"), "node-with-a-fault");
    EXPECT_EQ(one.at("chunk"), 2);
    EXPECT_GT(one.at("subpixels"), 0);
  }
}

/// Another node finishes the chunk first, with other bytes.
TEST_F(FarmCommand, RenderHasAnExitCodeOfItsOwnWhenAnotherNodesBytesDiffer) {
  plan("0:120", "120");
  ASSERT_EQ(render_chunk(0).exit_code, 0);
  const std::string report_file = work() + "/reports/000000.json";
  json other = json::parse(std::ifstream(report_file));
  std::filesystem::remove(report_file);
  std::filesystem::remove(chunk_file(0));
  const auto is_writing = [&] {
    std::error_code error;
    std::filesystem::recursive_directory_iterator at(work() + "/attempts", error);
    for (; !error && at != std::filesystem::end(at); at.increment(error))
      if (at->path().filename().string().find("chunk.lts") != std::string::npos) return true;
    return false;
  };
  BackgroundProcess slow(chunk_words(0));
  while (!is_writing()) usleep(1000);
  slow.signal(SIGSTOP);
  ASSERT_EQ(status().at("chunks_done"), 0) << "the process was stopped too late";
  other["digest"] = std::string(32, '0');
  other["node"] = "node-with-a-fault";
  other["bytes"] = 3;
  std::ofstream(work() + "/chunks/000000-" + std::string(32, '0') + ".lts") << "abc";
  std::ofstream(report_file) << other.dump();
  slow.signal(SIGCONT);
  expect_end(slow.wait(std::chrono::seconds(300)), 5, "other bytes than node-with-a-fault");
  const json now = status();
  EXPECT_EQ(now.at("differing"), json::array({0}));
  EXPECT_EQ(now.at("nodes").at(0).at("node"), "node-with-a-fault") << "the first result stays";
  EXPECT_EQ(merge().exit_code, 4);
  EXPECT_EQ(render_chunk(0).exit_code, 0) << "the chunk is done";
}

/// Returns the columns FRAME and XXH64 of a record of the virtual display.
std::vector<std::string> shown_frames(const std::string& record) {
  std::ifstream file(record);
  std::vector<std::string> frames;
  for (std::string vblank, frame; file >> vblank && std::getline(file, frame);)
    if (vblank != "#") frames.push_back(frame);
  return frames;
}

TEST_F(FarmCommand, FeedPlaysEachFrameOnceInOrderWhileChunksCome) {
  plan("0:40", "8");
  const auto play = [&](const std::string& source, const std::string& record) {
    return program({"play", source, "--rig", rig_, "--display", "virtual", "--clock", "simulated",
                    "--wait", "600", "--record", "checksums:" + path(record), "--json"});
  };
  BackgroundProcess player(play("ring:" + path("ring"), "fed.txt"));
  BackgroundProcess feed(
      program({"farm", "feed", work(), "ring:" + path("ring"), "--ring-timeout", "600", "--json"}));
  for (const uint64_t chunk : {2U, 0U, 4U, 1U, 3U}) ASSERT_EQ(render_chunk(chunk).exit_code, 0);
  const ProcessResult fed = feed.wait(std::chrono::seconds(600));
  ASSERT_EQ(fed.exit_code, 0) << fed.err;
  EXPECT_EQ(json::parse(fed.out).at("frames_delivered"), 40);
  expect_end(player.wait(std::chrono::seconds(600)), 0);
  // The merged film is shown in the same way.
  ASSERT_EQ(merge().exit_code, 0);
  ASSERT_EQ(run_process(play(path("film.lts"), "film.txt")).exit_code, 0);
  EXPECT_EQ(shown_frames(path("fed.txt")).size(), 40U);
  EXPECT_EQ(shown_frames(path("fed.txt")), shown_frames(path("film.txt")));
}

TEST_F(FarmCommand, FeedShowsTheFirstChunkWhileTheOthersAreMissing) {
  plan("0:40", "8");
  ASSERT_EQ(render_chunk(0).exit_code, 0);
  BackgroundProcess player(
      program({"play", "ring:" + path("ring"), "--rig", rig_, "--display", "virtual", "--clock",
               "simulated", "--prime", "1", "--wait", "600", "--duration", "2", "--json"}));
  BackgroundProcess feed(
      program({"farm", "feed", work(), "ring:" + path("ring"), "--ring-timeout", "600", "--json"}));
  EXPECT_GT(results_of(player.wait(std::chrono::seconds(600))).at("shown"), 0);
  feed.signal(SIGINT);
  const ProcessResult fed = feed.wait(std::chrono::seconds(60));
  EXPECT_EQ(fed.exit_code, 130) << fed.err;
  EXPECT_EQ(json::parse(fed.out).at("interrupted"), true);
}

TEST_F(FarmCommand, StatusWatchesUntilAllChunksAreDone) {
  plan();
  BackgroundProcess watch(program({"farm", "status", work(), "--watch"}));
  render_all();
  const ProcessResult watched = watch.wait(std::chrono::seconds(60));
  ASSERT_EQ(watched.exit_code, 0) << watched.err;
  EXPECT_NE(watched.out.find("40 of 40 frames (100.0 %), 5 of 5 chunks"), std::string::npos)
      << watched.out;
}

}  // namespace
}  // namespace lenticule::test
