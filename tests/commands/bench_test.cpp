// SPDX-License-Identifier: Apache-2.0
// Tests that `lenticule bench` measures the requested scenes and methods. The measured figures are
// not checked.
#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/commands/program.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {
namespace {

class BenchTest : public CommandTest {};

std::vector<std::string> bench_exact(std::vector<std::string> more) {
  const std::vector<std::string> arguments = joined(
      {"bench", "exact", "--rig", source_file("scenes/rigs/tiny.toml"), "--runs", "1", "--json"},
      more);
  return arguments;
}

TEST_F(BenchTest, ErrorMeasuresEveryMethodInBothScenarios) {
  const auto json =
      results_of(run({"bench", "error", "--quick", "--rig", source_file("scenes/rigs/tiny.toml"),
                      "--methods", "interpolate,temporal,none-such", "--frames", "3", "--no-peers",
                      "--json", "--svg", path("error.svg"), "--pictures", path("worst")}));
  ASSERT_EQ(json.at("courses").size(), 2U);
  for (const auto& scenario : json["courses"]) {
    EXPECT_EQ(scenario.at("scene"), "teapot");
    ASSERT_EQ(scenario.at("methods").size(), 4U);
    EXPECT_EQ(scenario["methods"][0].at("name"), "full");
    const auto& interpolate = scenario["methods"][1];
    EXPECT_GT(interpolate.at("psnr_mean_db").get<double>(), 10.0);
    EXPECT_GT(interpolate.at("flip_mean").get<double>(), 0.0);
    EXPECT_LT(interpolate.at("ssim_mean").get<double>(), 1.0);
    EXPECT_EQ(scenario["methods"][3].at("missing"), true);
    for (const auto& picture : scenario.at("pictures"))
      EXPECT_GT(std::filesystem::file_size(picture.at("file").get<std::string>()), 500U);
  }
  EXPECT_EQ(json["courses"][0].at("course"), "still");
  EXPECT_EQ(json["courses"][1].at("methods")[1].at("frames").size(), 3U);
  EXPECT_GE(json["courses"][1].at("pictures").size(), 2U);
  EXPECT_GT(std::filesystem::file_size(path("error.svg")), 500U);
}

TEST_F(BenchTest, CalibratesASimulatedPanelAndSavesItsRigReportAndPictures) {
  const auto json =
      results_of(run({"bench", "calibrate", "--plain", "--panel-width", "640", "--camera-width",
                      "480", "--viewpoints", "1", "--noise", "0.003", "--deformation", "0",
                      "--pictures", path("seen"), "-o", path("sim.toml"), "--json"},
                     {.timeout = std::chrono::seconds(300)}));
  EXPECT_EQ(json.at("ground_truth").at("failure"), "");
  EXPECT_LT(json["ground_truth"].at("effective_pitch_error").get<double>(), 1e-3);
  EXPECT_TRUE(std::filesystem::exists(path("sim.toml")));
  EXPECT_TRUE(std::filesystem::exists(path("sim.report.html")));
  EXPECT_TRUE(std::filesystem::exists(path("seen") + "/centre-000.png"));
}

TEST_F(BenchTest, ErrorRefusesUnknownScenesErrorsAndScenarios) {
  EXPECT_EQ(run({"bench", "error", "no-such-scene"}).exit_code, 4);
  EXPECT_EQ(run({"bench", "error", "--errors", "-1"}).exit_code, 2);
  EXPECT_EQ(run({"bench", "error", "--course", "sitting"}).exit_code, 2);
  EXPECT_EQ(run({"bench", "error", "gltf:balls", "--rig", source_file("scenes/rigs/tiny.toml")})
                .exit_code,
            2);
}

TEST_F(BenchTest, ExactMeasuresTheClassicScenesWithTwoLightsAndOneMirror) {
  const auto json = results_of(run(bench_exact({})));
  EXPECT_EQ(json.at("depth"), 1);
  ASSERT_EQ(json.at("scenes").size(), 3U);
  EXPECT_EQ(json["scenes"][2].at("scene"), "builtin:tree");
  EXPECT_EQ(json["scenes"][2].at("lights"), 2);
  EXPECT_EQ(json["scenes"][2].at("lights_dropped"), 5);
  for (const auto& scene : json["scenes"]) {
    ASSERT_GE(scene.at("rows").size(), 3U);
    EXPECT_EQ(scene["rows"][2].at("name"), "whole frame");
    for (const auto& row : scene["rows"]) EXPECT_GT(row.at("ns_per_subpixel").get<double>(), 0.0);
  }
}

TEST_F(BenchTest, ExactPlotsGrowthAndScaling) {
  const auto json = results_of(
      run(bench_exact({"--scene", "tree:2", "--scaling", "--growth", "--plots", path("plots")})));
  EXPECT_FALSE(json.contains("scenes"));
  EXPECT_EQ(json.at("growth").size(), 4U);
  EXPECT_EQ(json.at("growth")[2].at("rows").size(), 7U);
  for (const char* name :
       {"scaling", "growth-subpixels", "growth-triangles", "growth-lights", "growth-pitch"})
    EXPECT_GT(std::filesystem::file_size(path(std::string("plots/") + name + ".svg")), 500U)
        << name;
}

TEST_F(BenchTest, ExactComparesWithAnUprightRig) {
  EXPECT_GT(results_of(run(bench_exact({"--scene", "teapot:2", "--upright"})))
                .at("upright")[0]
                .at("slanted_over_upright"),
            0.0);
}

TEST_F(BenchTest, CoresSimulatesMoreCoresThanTheMachineHas) {
  const auto json =
      results_of(run({"bench", "cores", "teapot:2", "tree:2", "--rig",
                      source_file("scenes/rigs/paper-64.toml"), "--runs", "1", "--json"}));
  ASSERT_EQ(json.at("scenes").size(), 2U);
  for (const auto& scene : json["scenes"]) {
    const auto& speed_up = scene.at("speed_up");
    EXPECT_DOUBLE_EQ(speed_up.at("1").get<double>(), 1.0);
    EXPECT_GT(speed_up.at("2").get<double>(), 1.0);
    EXPECT_LE(speed_up.at("2").get<double>(), 2.0);
    EXPECT_GE(speed_up.at("64").get<double>(), speed_up.at("2").get<double>());
    EXPECT_GT(scene.at("measured_on_2").get<double>(), 0.0);
  }
}

TEST_F(BenchTest, StartMeasuresTheProgramAndItsFirstFrame) {
  const auto json = results_of(run(
      {"bench", "start", "--rig", source_file("scenes/rigs/tiny.toml"), "--runs", "1", "--json"}));
  EXPECT_GT(json.at("program_ms").get<double>(), 0.0);
  EXPECT_GT(json.at("first_frame_ms").get<double>(), 0.0);
}

/// Writes a stand-in for a reference renderer, which is found first in the path.
void write_program(const std::string& file, const std::string& script) {
  std::ofstream(file) << "#!/bin/sh\n" << script << '\n';
  std::filesystem::permissions(file, std::filesystem::perms::owner_all);
}

TEST_F(BenchTest, PlayMeasuresTheMemoryOfAPlayer) {
  EXPECT_EQ(results_of(run({"bench", "play", "--frames", "60", "--frames-4k", "2", "--rig",
                            source_file("scenes/rigs/tiny.toml"), "--runs", "1", "--json"}))
                .at("rows")
                .size(),
            2U);
}

std::vector<std::string> bench_realtime(std::vector<std::string> more) {
  const std::vector<std::string> arguments =
      joined({"bench", "realtime", "--rig", source_file("scenes/rigs/tiny.toml"), "--json"}, more);
  return arguments;
}

void expect_consistent(const nlohmann::json& run) {
  const auto rendered = run.at("frames_rendered").get<int>();
  EXPECT_GT(run.at("frames_shown").get<int>(), 0);
  EXPECT_LE(run.at("frames_shown").get<int>(), rendered);
  EXPECT_LE(rendered, 60);  // 2 s of 30 frames
  EXPECT_EQ(run.at("player").at("shown"), run.at("frames_shown"));
  const auto& latency = run.at("latency_ms");
  EXPECT_GT(latency.at("p50").get<double>(), 0.0);
  EXPECT_LE(latency.at("p50").get<double>(), latency.at("p99").get<double>());
  EXPECT_LE(latency.at("p99").get<double>(), latency.at("max").get<double>());
  double parts = 0.0;
  for (const auto& part : run.at("latency_parts_ms")) {
    EXPECT_GE(part.get<double>(), 0.0);
    parts += part.get<double>();
  }
  EXPECT_NEAR(parts, latency.at("mean").get<double>(), 0.01);
  double shares = 0.0;
  for (const auto& share : run.at("shares")) shares += share.get<double>();
  EXPECT_NEAR(shares, 1.0, 1e-6);
  EXPECT_TRUE(run.at("shares").contains(run.at("bound").get<std::string>()));
  EXPECT_EQ(run.at("samples").size(), 2U);
  for (const auto& sample : run.at("samples")) EXPECT_LT(sample.at("frame").get<int>(), rendered);
  EXPECT_GT(run.at("memory_mib").at("start").get<double>(), 1.0);
  EXPECT_GT(run.at("cpu_s_per_frame").get<double>(), 0.0);
  EXPECT_EQ(run.at("interrupted"), false);
}

TEST_F(BenchTest, RealtimeShowsFramesOfEachError) {
  // On the tiny rig method adaptive leaves everything to method full.
  std::string rig = read_text(source_file("scenes/rigs/tiny.toml"));
  rig.replace(rig.find("width_px = 48"), 13, "width_px = 480");
  rig.replace(rig.find("height_px = 32"), 14, "height_px = 288");
  write("rig.toml", rig);
  const auto json =
      results_of(run({"bench", "realtime", "teapot", "--rig", path("rig.toml"), "--seconds", "2",
                      "--errors", "0,8", "--samples", "2", "--plots", path("plots"), "--json"}));
  ASSERT_EQ(json.at("runs").size(), 2U);
  for (const auto& one : json["runs"]) expect_consistent(one);
  EXPECT_EQ(json["runs"][0].at("method"), "adaptive 0");
  EXPECT_EQ(json["runs"][0].at("max"), 0);
  EXPECT_EQ(json["runs"][0].at("rmse"), 0.0);
  EXPECT_TRUE(json["runs"][0].at("psnr_db").is_null());
  EXPECT_GT(json["runs"][1].at("max").get<int>(), 0);
  EXPECT_EQ(listing(), (std::vector<std::string>{"plots", "plots/teapot-288-adaptive-0.svg",
                                                 "plots/teapot-288-adaptive-8.svg", "rig.toml"}));
}

TEST_F(BenchTest, RealtimeAdaptsTheError) {
  // A rate that the tiny rig exceeds by far, so the error falls to its limit.
  const auto one = results_of(run(bench_realtime({"teapot", "--seconds", "2", "--adapt-error",
                                                  "0.5", "--samples", "2"})))
                       .at("runs")
                       .at(0);
  expect_consistent(one);
  EXPECT_EQ(one.at("adapt_rate"), 0.5);
  EXPECT_EQ(one.at("error_range").at("last"), 0.5);
  EXPECT_EQ(one.at("error_range").at("most"), 2.0);
}

TEST_F(BenchTest, RealtimeEndsWithTheResultsSoFarWhenInterrupted) {
  // A busy machine may need longer until the first frame is shown.
  nlohmann::json one;
  for (const int seconds : {1, 4, 16}) {
    BackgroundProcess bench(
        program(bench_realtime({"teapot", "--errors", "2", "--seconds", "600"})));
    std::this_thread::sleep_for(std::chrono::seconds(seconds));
    bench.signal(SIGINT);
    const ProcessResult result = bench.wait(std::chrono::seconds(60));
    ASSERT_EQ(result.exit_code, 130) << result.err;
    one = nlohmann::json::parse(result.out).at("runs").at(0);
    if (one.at("frames_shown").get<int>() > 1) break;
  }
  EXPECT_GT(one.at("frames_shown").get<int>(), 1);
  EXPECT_GT(one.at("frames_per_s").get<double>(), 0.0);
  EXPECT_EQ(one.at("interrupted"), true);
  EXPECT_TRUE(one.at("rmse").is_null());
}

TEST_F(BenchTest, RealtimeFailsWhenItsRendererDies) {
  BackgroundProcess bench(program(bench_realtime({"teapot", "--errors", "2", "--seconds", "600"})));
  const std::string id = std::to_string(bench.pid());
  pid_t renderer = 0;
  for (int tries = 0; tries < 600 && renderer == 0; ++tries) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    std::ifstream("/proc/" + id + "/task/" + id + "/children") >> renderer;
  }
  ASSERT_GT(renderer, 0);
  ASSERT_EQ(kill(renderer, SIGKILL), 0);
  expect_end(bench.wait(std::chrono::seconds(60)), 1, "the renderer process ended");
}

TEST_F(BenchTest, RealtimeNamesWhatItCannotMeasure) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"none-such"}, "none-such"},
      {{"--methods", "none-such"}, "no method 'none-such'"},
      {{"--adapt-error", "0"}, "--adapt-error 0"},
      {{"--fps", "90"}, "--fps: more than --refresh"}};
  for (const auto& [arguments, text] : cases) {
    const ProcessResult result = run(bench_realtime(arguments));
    EXPECT_NE(result.exit_code, 0) << text;
    EXPECT_NE(result.err.find(text), std::string::npos) << result.err;
  }
}

TEST_F(BenchTest, ReportsAPeerThatIsMissingOrFails) {
  write_program(path("tachyon"), "echo 'no memory' >&2; exit 9");
  std::vector<std::string> arguments = program(bench_exact({"--scene", "teapot:2", "--peers"}));
  arguments.insert(arguments.begin(), {"/usr/bin/env", "PATH=" + path("")});
  const auto json = results_of(run_process(arguments));
  const auto& rows = json.at("peers")[0].at("rows");
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows[0].at("failure"), "failed with exit code 9");
  std::filesystem::remove(path("tachyon"));
  const auto without = nlohmann::json::parse(run_process(arguments).out);
  EXPECT_EQ(without.at("peers")[0].at("rows")[0].at("failure"),
            "not installed (scripts/packages bench)");
}

TEST_F(BenchTest, ComputesTheRatioFromThePeersOwnTime) {
  write_program(path("tachyon"), "echo '  Ray Tracing Time:     2.0000 seconds'");
  std::vector<std::string> arguments = program(bench_exact({"--scene", "teapot:2", "--peers"}));
  arguments.insert(arguments.begin(), {"/usr/bin/env", "PATH=" + path("")});
  const auto json = nlohmann::json::parse(run_process(arguments).out);
  const auto& peers = json.at("peers")[0];
  for (const auto& row : peers.at("rows"))
    EXPECT_NEAR(row.at("ours_over_theirs").get<double>() * row.at("mray_s").get<double>(),
                peers.at("ours_mray_s").get<double>(), 1e-6);
  EXPECT_EQ(peers["rows"][0].at("seconds"), 2.0);
}

class BenchPaper : public CommandTest {
 protected:
  [[nodiscard]] static std::vector<std::string> arguments(std::vector<std::string> more) {
    const std::vector<std::string> all =
        joined({"bench", "paper", "--rig", source_file("scenes/rigs/tiny.toml"), "--runs", "1",
                "--spans", "1", "--depth", "1", "--no-peers"},
               more);
    return all;
  }
};

TEST_F(BenchPaper, MeasuresASpanOfEachSceneWithEachMethod) {
  const nlohmann::json out =
      results_of(run(arguments({"--scene", "teapot", "--scene", "room", "--json"})));
  ASSERT_EQ(out.at("scenes").size(), 2U);
  for (const nlohmann::json& scene : out["scenes"]) {
    EXPECT_EQ(scene.at("frames"), 16);
    ASSERT_FALSE(scene.at("methods").empty());
    EXPECT_EQ(scene["methods"][0].at("name"), "full");
    for (const nlohmann::json& method : scene["methods"])
      EXPECT_GT(method.at("seconds_per_frame").get<double>(), 0.0);
  }
  // The frames are those of the paper's table, also if another span is in the middle.
  EXPECT_EQ(out.at("teapot")[0].at("first"), 96);
}

TEST_F(BenchPaper, ContinuesFromItsStateAndRefusesAnother) {
  const std::vector<std::string> first =
      arguments({"--scene", "tree", "--state", path("state.json"), "--json"});
  const ProcessResult once = run(first);
  ASSERT_EQ(once.exit_code, 0) << once.err;
  // Equal figures to the last digit show that the second run measured nothing again.
  const ProcessResult again = run(first);
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(once.out, again.out);

  std::vector<std::string> other = first;
  other.insert(other.end(), {"--threads", "1"});
  expect_end(run(other), 4, "state.json: the state file is of a run with other settings");

  write("state.json", "{\"spans\": 3}");
  expect_end(run(first), 4, "not a state file");
}

TEST_F(BenchPaper, NamesUnknownScenesAndMethods) {
  expect_end(run(arguments({"--scene", "kettle"})), 2, "kettle");
  expect_end(run(arguments({"--method", "guess"})), 2, "--method 'guess': unknown");
}

}  // namespace
}  // namespace lenticule::test
