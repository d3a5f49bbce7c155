// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/realtime/realtime.h"
#include "apps/lenticule-tools/cli/svg_plot.h"
#include "base/print.h"

namespace lenticule::bench {
namespace {

using tools::PlotSeries;

using nlohmann::json;

double number(const json& from, const char* key) {
  return from.at(key).get<double>();
}

/// Returns the name of a share as a sentence has it.
std::string bound_text(const std::string& name) {
  if (name == "scene") return "evaluating and committing the scene";
  if (name == "render") return "rendering";
  if (name == "ring") return "waiting for a free slot of the ring";
  if (name == "copy") return "copying into the ring";
  if (name == "wait") return "waiting for the next frame of the scene";
  return name;
}

std::string error_text(const json& run) {
  if (run.at("rmse").is_null()) return "not compared with method full";
  if (run.at("psnr_db").is_null())
    return fmt::format("none: {} frames equal those of method full", run.at("samples").size());
  return fmt::format(
      "RMSE {:.2f}, PSNR {} dB, worst frame {} dB, largest {} code values; {} frames",
      number(run, "rmse"), decibels(run.at("psnr_db")), decibels(run.at("psnr_worst_db")),
      run.at("max").get<int>(), run.at("samples").size());
}

PlotSeries course_series(const json& run, const char* label, const char* key) {
  PlotSeries series{.label = label, .points = {}};
  for (const json& point : run.at("course"))
    if (const double value = number(point, key); value > 0.0)
      series.points.push_back({number(point, "at_s"), value});
  return series;
}

}  // namespace

void print_realtime(const json& run) {
  const json& latency = run.at("latency_ms");
  const json& parts = run.at("latency_parts_ms");
  const json& shares = run.at("shares");
  const json& player = run.at("player");
  const json& memory = run.at("memory_mib");
  print_out("{}, {}, {} x {}, {}\n", run.at("scene").get<std::string>(),
            run.at("rig").get<std::string>(), run.at("width").get<int>(),
            run.at("height").get<int>(), run.at("method").get<std::string>());
  print_out(
      "  rate     {:.2f} frames/s: {} shown of {} rendered in {:.1f} s; {:.3f} s of processor "
      "time each\n",
      number(run, "frames_per_s"), run.at("frames_shown").get<uint64_t>(),
      run.at("frames_rendered").get<uint64_t>(), number(run, "seconds_shown"),
      number(run, "cpu_s_per_frame"));
  print_out(
      "  latency  {:.0f} ms from the scene's instant to the panel; p99 {:.0f}, largest {:.0f}\n",
      number(latency, "p50"), number(latency, "p99"), number(latency, "max"));
  print_out(
      "           means: begin {:.1f}, scene {:.1f}, render {:.1f}, ring {:.1f}, copy {:.1f}, "
      "panel {:.1f}\n",
      number(parts, "begin"), number(parts, "scene"), number(parts, "render"),
      number(parts, "ring"), number(parts, "copy"), number(parts, "panel"));
  if (const std::string bound = run.at("bound"); shares.contains(bound))
    print_out("  bound    {}: {:.1f} % of the renderer's time\n", bound_text(bound),
              100.0 * number(shares, bound.c_str()));
  print_out(
      "  player   {} of {} vblanks missed, {} submitted late; wakes within {:.1f} ms (p99){}; "
      "{:.1f} "
      "ms to copy a frame; {:.1f} % of a core\n",
      player.at("missed_vblanks").get<uint64_t>(), player.at("vblanks").get<uint64_t>(),
      player.at("late_submits").get<uint64_t>(), number(player, "wake_ms_p99"),
      player.at("real_time").get<bool>() ? "" : ", without real-time priority",
      number(player, "copy_ms_p50"), 100.0 * number(player, "cpu_of_vblank"));
  print_out("  error    {}\n", error_text(run));
  if (const json& range = run.at("error_range"); !run.at("adapt_rate").is_null())
    print_out("  E        {:.2f} to {:.2f} code values, median {:.2f}, last {:.2f}\n",
              number(range, "least"), number(range, "most"), number(range, "median"),
              number(range, "last"));
  print_out(
      "  memory   renderer {:.0f} MiB at first, {:.0f} after a tenth, {:.0f} at the end, of which "
      "in use {:.2f} -> {:.2f}; player {:.0f} -> {:.0f} MiB\n\n",
      number(memory, "start"), number(memory, "tenth"), number(memory, "end"),
      number(memory, "in_use_tenth"), number(memory, "in_use_end"),
      number(player.at("memory_mib"), "start"), number(player.at("memory_mib"), "end"));
}

void print_realtime_table(const json& runs) {
  if (runs.size() < 2) return;
  print_out("{:<14} {:<16} {:>8} {:>8} {:>8} {:>7} {:>7}  {:<7} {:>6}\n", "scene", "method",
            "frames/s", "ms p50", "ms p99", "missed", "dB", "bound", "MiB +");
  for (const json& run : runs)
    print_out("{:<14} {:<16} {:>8.2f} {:>8.0f} {:>8.0f} {:>7} {:>7}  {:<7} {:>6.0f}\n",
              run.at("scene").get<std::string>(), run.at("method").get<std::string>(),
              number(run, "frames_per_s"), number(run.at("latency_ms"), "p50"),
              number(run.at("latency_ms"), "p99"),
              run.at("player").at("missed_vblanks").get<uint64_t>(),
              run.at("rmse").is_null() ? "-" : decibels(run.at("psnr_db")),
              run.at("bound").get<std::string>(),
              number(run.at("memory_mib"), "end") - number(run.at("memory_mib"), "tenth"));
}

void plot_realtime(const json& run, const std::string& file) {
  tools::Plot plot{.title = fmt::format("{}, {} x {}, {}", run.at("scene").get<std::string>(),
                                        run.at("width").get<int>(), run.at("height").get<int>(),
                                        run.at("method").get<std::string>()),
                   .x = {.label = "seconds"},
                   .y = {.label = "frames/s, code values", .scale = tools::AxisScale::Log},
                   .series = {course_series(run, "frames/s", "frames_per_s"),
                              course_series(run, "tolerated E", "tolerated_error"),
                              course_series(run, "RMSE, audit", "audited_rmse")}};
  PlotSeries measured{.label = "RMSE, measured", .points = {}, .joined = false};
  for (const json& sample : run.at("samples"))
    if (const double mse = number(sample, "mse"); mse > 0.0)
      measured.points.push_back({number(sample, "at_s"), std::sqrt(mse)});
  plot.series.push_back(std::move(measured));
  std::erase_if(plot.series, [](const PlotSeries& series) { return series.points.empty(); });
  if (!plot.series.empty()) write_svg(plot, file);
}

}  // namespace lenticule::bench
