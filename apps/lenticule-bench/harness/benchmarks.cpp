// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <string_view>
#include <thread>

#include "apps/lenticule-bench/harness/bench.h"
#include "base/cpu.h"
#include "optics/trim.h"

namespace lenticule::player {

// One file per benchmark; each defines its function.
Run declare_bench_codec(CLI::App& app);
Run declare_bench_depth(CLI::App& app);
Run declare_bench_error(CLI::App& app);
Run declare_bench_exact(CLI::App& app);
Run declare_bench_memory(CLI::App& app);
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

optics::Rig kiosk_rig() {
  optics::Rig rig;
  rig.name = "kiosk 27-inch 4K";
  rig.panel.width_px = 3840;
  rig.panel.height_px = 2160;
  rig.panel.pixel_width = Millimetres(0.15567);
  rig.panel.pixel_height = Millimetres(0.15567);
  rig.sheet.pitch = Subpixels(7.701);
  rig.sheet.slant = 0.2521;
  rig.sheet.gap = Millimetres(2.238);
  rig.sheet.refraction_shape = 0.4444444444444444;
  rig.viewing.distance = Millimetres(700.0);
  return rig;
}

optics::Rig paper_rig() {
  optics::Rig rig;
  rig.name = "64 lenses of 8 pixels";
  rig.panel.width_px = 512;
  rig.panel.height_px = 384;
  rig.panel.pixel_width = Millimetres(0.25);
  rig.panel.pixel_height = Millimetres(0.25);
  rig.sheet.pitch = Subpixels(24.0);
  rig.sheet.offset = Lenses(0.5);
  rig.sheet.gap = Millimetres(4.0);
  rig.sheet.refraction_shape = 0.4444444444444444;
  rig.sheet.spot_sigma = Lenses(0.02);
  rig.viewing.distance = Millimetres(std::numeric_limits<double>::infinity());
  return rig;
}

optics::Rig coarser_rig(const optics::Rig& rig, int factor) {
  if (factor == 1) return rig;
  optics::Rig coarser = rig;
  coarser.panel.width_px /= factor;
  coarser.panel.height_px /= factor;
  coarser.name += fmt::format(", {} x {}", coarser.panel.width_px, coarser.panel.height_px);
  coarser.panel.pixel_width = Millimetres(factor * rig.panel.pixel_width.value);
  coarser.panel.pixel_height = Millimetres(factor * rig.panel.pixel_height.value);
  coarser.sheet.gap = Millimetres(factor * rig.sheet.gap.value);
  return coarser;
}

optics::Rig bench_rig(const std::string& file) {
  return file.empty() ? kiosk_rig() : optics::load_trimmed_rig(file);
}

nlohmann::json psnr_or_null(double mse) {
  return mse > 0.0 ? nlohmann::json(10.0 * std::log10(255.0 * 255.0 / mse)) : nlohmann::json();
}

std::string decibels(const nlohmann::json& psnr) {
  return psnr.is_null() ? "equal" : fmt::format("{:.1f}", psnr.get<double>());
}

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  const size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

}  // namespace lenticule::player
