// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <memory>
#include <thread>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule/cli/command.h"
#include "base/cpu.h"
#include "base/print.h"

namespace lenticule::bench {

using cli::Run;

// Each function is defined in the file of its benchmark.
Run declare_bench_codec(CLI::App& app);
Run declare_bench_cores(CLI::App& app);
Run declare_bench_error(CLI::App& app);
Run declare_bench_exact(CLI::App& app);
Run declare_bench_flip(CLI::App& app);
Run declare_bench_memory(CLI::App& app);
Run declare_bench_models(CLI::App& app);
Run declare_bench_paper(CLI::App& app);
Run declare_bench_play(CLI::App& app);
Run declare_bench_realtime(CLI::App& app);
Run declare_bench_calibrate(CLI::App& app);
Run declare_bench_stability(CLI::App& app);
Run declare_bench_start(CLI::App& app);
Run declare_bench_weave(CLI::App& app);
Run declare_bench_video(CLI::App& app);

namespace {

std::string cpu_name() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const size_t colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown";
}

struct Benchmark {
  const char* name;
  const char* summary;
  cli::Declare declare;  ///< declares the flags of `lenticule bench NAME`, as for a command
};

/// Returns all benchmarks, in the order in which `bench list` prints them.
const std::vector<Benchmark>& benchmarks() {
  static const std::vector<Benchmark> table = {
      {"codec", "size and speed of the sequence container, compared with other lossless formats",
       declare_bench_codec},
      {"cores", "speed-up of method adaptive on many cores, simulated from the times of its work",
       declare_bench_cores},
      {"error", "run time against error of every render method, and pictures of the worst places",
       declare_bench_error},
      {"exact", "rates of bare Embree, of visibility and of whole frames of method full",
       declare_bench_exact},
      {"flip", "two pictures: FLIP, what a viewer notices when they alternate", declare_bench_flip},
      {"memory", "peak memory of rendering one frame", declare_bench_memory},
      {"models", "glTF models beside the pictures of another renderer, compared by FLIP",
       declare_bench_models},
      {"paper", "the reuse methods, in the tables of the paper they come from",
       declare_bench_paper},
      {"play", "memory of the player over many frames of a ring", declare_bench_play},
      {"calibrate",
       "calibrations of random sheets with a simulated camera, compared with the ground truth",
       declare_bench_calibrate},
      {"realtime",
       "frames per second, latency and error of a renderer and a player, live on this machine",
       declare_bench_realtime},
      {"stability",
       "numerical stress cases against reference implementations; fails if one deviates",
       declare_bench_stability},
      {"start", "from starting the program to the first frame on the virtual display",
       declare_bench_start},
      {"weave", "time of weaving views, against copying the woven frame", declare_bench_weave},
      {"video", "speed of decoding woven frames from video files, against PNG files",
       declare_bench_video},
  };
  return table;
}

}  // namespace

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

void print_table(const nlohmann::json& rows, std::span<const Column> columns,
                 std::string_view indent) {
  std::vector<std::string> lines(rows.size() + 1, std::string(indent));
  for (const Column& column : columns) {
    const nlohmann::json::json_pointer place(std::string("/") + column.key);
    std::vector<std::string> cells = {column.head};
    bool is_text = false;
    for (const nlohmann::json& row : rows) {
      std::string& cell = cells.emplace_back("-");
      if (!row.contains(place)) continue;
      const nlohmann::json& value = row.at(place);
      is_text = is_text || value.is_string();
      cell = value.is_null() ? column.null
             : value.is_string()
                 ? value.get<std::string>()
                 : fmt::format(fmt::runtime(column.format), column.factor * value.get<double>());
    }
    const size_t width = std::ranges::max(cells, {}, &std::string::size).size();
    for (size_t n = 0; n < cells.size(); ++n) {
      if (lines[n].size() > indent.size()) lines[n] += "  ";
      lines[n] +=
          is_text ? fmt::format("{:<{}}", cells[n], width) : fmt::format("{:>{}}", cells[n], width);
    }
  }
  for (const std::string& line : lines)
    print_out("{}\n", line.substr(0, line.find_last_not_of(' ') + 1));
}

void declare_run_flags(CLI::App& app, RunFlags& flags) {
  app.add_option("--rig", flags.rig, "rig file (default: the 4K kiosk)");
  app.add_option("--runs", flags.runs, "number of interleaved runs; medians are reported")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_flag("--json", flags.json, "print as JSON");
}

void declare_threads(CLI::App& app, int& threads) {
  app.add_option("--threads", threads, "0 means all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
}

void declare_depth(CLI::App& app, const char* name, int& depth) {
  app.add_option(name, depth, "number of bounces of mirrored and refracted rays")
      ->check(CLI::Range(0, 64))
      ->capture_default_str();
}

namespace {

cli::Run declare_list(CLI::App& app) {
  auto json = std::make_shared<bool>(false);
  app.add_flag("--json", *json, "print as JSON");
  return [json]() -> ExitCode {
    nlohmann::json list = nlohmann::json::array();
    for (const Benchmark& benchmark : benchmarks())
      list.push_back({{"name", benchmark.name}, {"summary", benchmark.summary}});
    if (*json) {
      print_json(list);
      return kOk;
    }
    constexpr Column kColumns[] = {{"benchmark", "name"}, {"", "summary"}};
    print_table(list, kColumns);
    return kOk;
  };
}

}  // namespace

cli::Run declare_all_benchmarks(CLI::App& app) {
  app.require_subcommand(1);
  auto runs = std::make_shared<std::map<const CLI::App*, cli::Run>>();
  CLI::App* list = app.add_subcommand("list", "list the benchmarks");
  (*runs)[list] = declare_list(*list);
  for (const Benchmark& benchmark : benchmarks()) {
    CLI::App* sub = app.add_subcommand(benchmark.name, benchmark.summary);
    sub->footer(fmt::format("Example:\n  lenticule bench {}", benchmark.name));
    (*runs)[sub] = benchmark.declare(*sub);  // a benchmark may set its own example
  }
  return [&app, runs]() -> ExitCode { return runs->at(app.get_subcommands().front())(); };
}
}  // namespace lenticule::bench
