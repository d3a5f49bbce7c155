// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <string_view>
#include <thread>

#include "apps/lenticule-bench/harness/bench.h"
#include "base/cpu.h"

namespace lenticule::player {

// Each function is defined in the file of its benchmark.
Run declare_bench_codec(CLI::App& app);
Run declare_bench_depth(CLI::App& app);
Run declare_bench_error(CLI::App& app);
Run declare_bench_exact(CLI::App& app);
Run declare_bench_memory(CLI::App& app);
Run declare_bench_models(CLI::App& app);
Run declare_bench_paper(CLI::App& app);
Run declare_bench_play(CLI::App& app);
Run declare_bench_calibrate(CLI::App& app);
Run declare_bench_reuse(CLI::App& app);
Run declare_bench_stability(CLI::App& app);
Run declare_bench_start(CLI::App& app);
Run declare_bench_weave(CLI::App& app);
Run declare_bench_video(CLI::App& app);
Run declare_bench_visibility(CLI::App& app);

namespace {

std::string cpu_name() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const size_t colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown";
}

}  // namespace

const std::vector<Benchmark>& benchmarks() {
  static const std::vector<Benchmark> table = {
      {"codec", "size and speed of the sequence container beside other lossless ways",
       declare_bench_codec},
      {"depth", "prefiltered and plain rays in deep scenes, against the means over whole beams",
       declare_bench_depth},
      {"error", "run time against error of every render method, and pictures of the worst places",
       declare_bench_error},
      {"exact", "rates of bare Embree, of visibility and of whole frames of method full",
       declare_bench_exact},
      {"memory", "peak memory of rendering one frame", declare_bench_memory},
      {"models", "glTF models beside the pictures of another renderer, compared by FLIP",
       declare_bench_models},
      {"paper", "the methods that reuse points, in the tables of the paper they are from",
       declare_bench_paper},
      {"play", "the player's memory over many frames of a ring", declare_bench_play},
      {"calibrate", "calibrations of random sheets on the simulated bench, judged by the truth",
       declare_bench_calibrate},
      {"reuse", "time and error of the methods that reuse points, against method full",
       declare_bench_reuse},
      {"stability", "stress cases of the numbers against oracles; fails if one is off",
       declare_bench_stability},
      {"start", "from starting the program to the first frame on the virtual display",
       declare_bench_start},
      {"weave", "weaving views, against copying the woven frame", declare_bench_weave},
      {"video", "how fast woven frames come out of video files, beside PNG files",
       declare_bench_video},
      {"visibility",
       "the row sweep against Embree's packets and bare writing, and where they differ",
       declare_bench_visibility},
  };
  return table;
}

nlohmann::json machine_json() {
  return {{"cpu", cpu_name()},
          {"hardware_threads", std::thread::hardware_concurrency()},
          {"isa", isa_name(best_isa())}};
}

std::string machine_text() {
  return fmt::format("{}, {} hardware threads, {}", cpu_name(), std::thread::hardware_concurrency(),
                     isa_name(best_isa()));
}

nlohmann::json psnr_or_null(double mse) {
  return mse > 0.0 ? nlohmann::json(10.0 * std::log10(255.0 * 255.0 / mse)) : nlohmann::json();
}

std::string decibels(const nlohmann::json& psnr) {
  return psnr.is_null() ? "equal" : fmt::format("{:.1f}", psnr.get<double>());
}

}  // namespace lenticule::player
