// SPDX-License-Identifier: Apache-2.0
// lenticule bench start measures the time from program start to the first frame on the virtual
// display, from outside on the program itself.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-tools/offline/scratch_folder.h"
#include "base/error.h"
#include "base/print.h"
#include "frames/image_io.h"
#include "optics/rig_file.h"
#include "player/process/child_process.h"
#include "player/process/interrupt.h"

namespace lenticule::bench {
namespace {

struct StartFlags {
  std::string rig;
  int runs = 5;
  bool json = false;
};

struct ProgramOutput {
  std::string text;
  double seconds = 0.0;
};

std::string find_lenticule() {
  if (const auto program = player::find_sibling_program("lenticule")) return program->string();
  throw Error(ErrorKind::Failed, "lenticule: not found beside lenticule-bench",
              "install the package lenticule-player");
}

/// Runs lenticule with arguments that need no quoting in a shell.
ProgramOutput run_lenticule(const std::string& program, const std::string& arguments) {
  const auto begin = std::chrono::steady_clock::now();
  std::FILE* pipe = popen(fmt::format("'{}' {} 2>/dev/null", program, arguments).c_str(), "re");
  if (pipe == nullptr) throw Error(ErrorKind::Failed, program + ": cannot start");
  ProgramOutput output;
  char buffer[4096];
  for (size_t n = 0; (n = std::fread(buffer, 1, sizeof buffer, pipe)) > 0;)
    output.text.append(buffer, n);
  const int status = pclose(pipe);
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  if (status != 0) throw Error(ErrorKind::Failed, fmt::format("{} {}: failed", program, arguments));
  output.seconds = elapsed.count();
  return output;
}

/// Writes a test picture; noise decodes as slowly as real frames.
void write_noise(const optics::Rig& rig, const std::string& file) {
  frames::WovenFrame frame({rig.panel.width_px, rig.panel.height_px, frames::PixelFormat::Rgb8});
  uint32_t state = 1;
  for (uint8_t& byte : frame.bytes()) {
    state = state * 1664525u + 1013904223u;
    byte = static_cast<uint8_t>(state >> 29);
  }
  frames::write_woven(frame.view(), file);
}

ExitCode run(const StartFlags& flags) {
  const std::string program = find_lenticule();
  const optics::Rig rig = lab::bench_rig(flags.rig);
  const tools::ScratchFolder scratch;
  optics::save_rig(rig, scratch.file("rig.toml"));
  write_noise(rig, scratch.file("frame.png"));
  const std::string play =
      fmt::format("play '{}' --rig '{}' --display virtual --duration 0.1 --json",
                  scratch.file("frame.png"), scratch.file("rig.toml"));
  std::vector<double> loading;
  std::vector<double> first_frame;
  for (int i = 0; i < flags.runs && !player::interrupted(); ++i) {
    loading.push_back(1000.0 * run_lenticule(program, "--version").seconds);
    const auto report = nlohmann::json::parse(run_lenticule(program, play).text);
    first_frame.push_back(report.at("first_frame_ms").get<double>());
  }
  if (player::interrupted()) return player::interrupt_exit_code();

  const nlohmann::json result = {
      {"machine", machine_json()},
      {"width", rig.panel.width_px},
      {"height", rig.panel.height_px},
      {"runs", flags.runs},
      {"program_ms", median(loading)},
      {"first_frame_ms", median(first_frame)},
      {"start_to_first_frame_ms", median(loading) + median(first_frame)}};
  if (flags.json) {
    print_json(result);
    return kOk;
  }
  print_out("{}\n{} x {}, one PNG, virtual display, medians of {} runs\n", machine_text(),
            rig.panel.width_px, rig.panel.height_px, flags.runs);
  print_out("loading the program        {:7.0f} ms\n", result["program_ms"].get<double>());
  print_out("main() to the first frame  {:7.0f} ms\n", result["first_frame_ms"].get<double>());
  print_out("start to the first frame   {:7.0f} ms\n",
            result["start_to_first_frame_ms"].get<double>());
  return kOk;
}

}  // namespace

cli::Run declare_bench_start(CLI::App& app) {
  auto flags = std::make_shared<StartFlags>();
  app.add_option("--rig", flags->rig, "rig file (default: the 4K kiosk)");
  app.add_option("--runs", flags->runs, "number of runs; medians are reported")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_flag("--json", flags->json, "print as JSON");
  return [flags] { return run(*flags); };
}

}  // namespace lenticule::bench
