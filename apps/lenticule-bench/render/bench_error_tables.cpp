// SPDX-License-Identifier: Apache-2.0
// Prints the tables of `lenticule bench error` and draws its plot.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/render/bench_error.h"
#include "apps/lenticule-tools/cli/svg_plot.h"
#include "base/print.h"

namespace lenticule::bench {
namespace {

using tools::PlotSeries;

using nlohmann::json;

/// Returns "-" for a value that was not measured.
std::string text(const json& figures, const char* key, const char* format, double factor = 1.0) {
  if (!figures.contains(key) || figures[key].is_null()) return "-";
  return fmt::format(fmt::runtime(format), factor * figures[key].get<double>());
}

constexpr const char* kTimeRow =
    "  {:<14} {:>9} {:>9} {:>9} {:>7} {:>7} {:>7} {:>7} {:>6} {:>8} {:>7}\n";

void print_times(const json& methods) {
  print_out(kTimeRow, "time", "ms/frame", "first", "later", "saved", "later", "CPU", "later",
            "rays", "Tachyon", "copies");
  for (const json& m : methods) {
    const std::string name = m["name"];
    if (m["missing"].get<bool>()) continue;
    print_out(kTimeRow, name, text(m, "seconds_per_frame", "{:.2f}", 1e3),
              text(m, "first_s", "{:.2f}", 1e3), text(m, "later_s", "{:.2f}", 1e3),
              text(m, "saved", "{:.0f} %", 100), text(m, "later_saved", "{:.0f} %", 100),
              text(m, "cpu_of_full", "{:.0f} %", 100),
              text(m, "later_cpu_of_full", "{:.0f} %", 100), text(m, "rays_per_subpixel", "{:.2f}"),
              text(m, "over_tachyon", "{:.1f} x"), text(m, "over_copy", "{:.0f}"));
  }
}

void print_missing(const json& methods) {
  std::set<std::string> names;
  for (const json& m : methods)
    if (m["missing"].get<bool>()) names.insert(m["method"]);
  if (!names.empty())
    print_out("  not in this build: {}\n", fmt::format("{}", fmt::join(names, ", ")));
}

std::string bound_text(const json& bound) {
  if (bound.is_null()) return "-";
  return fmt::format("{:.0f} % of {}", bound["within_percent"].get<double>(),
                     bound["frames"].get<int>());
}

constexpr const char* kErrorRow =
    "  {:<14} {:>6} {:>6} {:>6} {:>4} {:>9} {:>9} {:>8} {:>8} {:>7} {:>7} {:>7} {:>7} {:>8} {:>4} "
    "{:>12}\n";

void print_errors(const json& methods) {
  print_out(kErrorRow, "error", "PSNR", "worst", "view", "max", "over E", "bound", "over 8",
            "over 32", "SSIM", "worst", "FLIP", "99 %", "flicker", "max", "within bound");
  for (const json& m : methods) {
    if (!m.contains("psnr_mean_db")) continue;
    print_out(kErrorRow, m["name"].get<std::string>(), decibels(m["psnr_mean_db"]),
              decibels(m["psnr_worst_db"]), decibels(m["worst_view_psnr_db"]),
              text(m, "max", "{:.0f}"), text(m, "share_over_e", "{:.4f} %", 100),
              text(m["bound"], "mean_bound", "{:.4f} %", 100),
              text(m, "share_over_8", "{:.3f} %", 100), text(m, "share_over_32", "{:.3f} %", 100),
              text(m, "ssim_mean", "{:.4f}"), text(m, "ssim_worst", "{:.4f}"),
              text(m, "flip_mean", "{:.4f}"), text(m, "flip_p99_worst", "{:.3f}"),
              text(m, "flicker_mean", "{:.4f}"), text(m, "flicker_largest", "{:.0f}"),
              bound_text(m["bound"]));
  }
}

/// Position in the plot of frames equal to full's, whose PSNR is infinite.
constexpr double kEqualDb = 80.0;

PlotSeries& series_of(tools::Plot& plot, const std::string& name) {
  const auto found = std::ranges::find(plot.series, name, &PlotSeries::label);
  if (found != plot.series.end()) return *found;
  return plot.series.emplace_back(PlotSeries{.label = name, .points = {}, .joined = false});
}

std::string tachyon_text(const json& tachyon) {
  if (tachyon.contains("mray_s"))
    return fmt::format("; Tachyon {:.2f} Mray/s", tachyon["mray_s"].get<double>());
  if (tachyon.contains("failure"))
    return fmt::format("; Tachyon {}", tachyon["failure"].get<std::string>());
  return "";
}

}  // namespace

void print_error_scenario(const json& scenario) {
  print_out("{}, {}, {}: {:.2f} M subpixels, copying them takes {:.2f} ms{}\n",
            scenario["scene"].get<std::string>(), scenario["rig"].get<std::string>(),
            scenario["course"].get<std::string>(), scenario["subpixels"].get<double>() / 1e6,
            1e3 * scenario["copy_s"].get<double>(), tachyon_text(scenario["tachyon"]));
  print_times(scenario["methods"]);
  print_errors(scenario["methods"]);
  print_missing(scenario["methods"]);
  for (const json& picture : scenario["pictures"])
    print_out("  {}: frame {}, pixel {}, {}, MSE {:.1f}\n", picture["file"].get<std::string>(),
              picture["frame"].get<int>(), picture["x"].get<int>(), picture["y"].get<int>(),
              picture["mse"].get<double>());
  print_out("\n");
}

void print_bound_of_all(const json& scenarios) {
  const json all = bound_of_all(scenarios);
  if (all.is_null()) return;
  print_out("the true share beyond E was within the reported bound in {:.1f} % of {} frames",
            all["within_percent"].get<double>(), all["frames"].get<int>());
  const double excess = all["largest_excess"].get<double>();
  print_out("{}\n", excess > 0.0 ? fmt::format(", at most {:.4f} % above it", 100.0 * excess) : "");
}

void plot_errors(const json& scenarios, const std::string& file) {
  tools::Plot plot{.title = "Time against error, each scene, rig and course",
                   .x = {.label = "time, as a share of full's", .scale = tools::AxisScale::Log},
                   .y = {.label = fmt::format("mean PSNR, dB ({:.0f}: equal, or more)", kEqualDb)},
                   .series = {}};
  for (const json& scenario : scenarios)
    for (const json& m : scenario["methods"]) {
      if (!m.contains("psnr_mean_db") || m["of_full"].is_null()) continue;
      const json& psnr = m["psnr_mean_db"];
      const double decibels = psnr.is_null() ? kEqualDb : std::min(kEqualDb, psnr.get<double>());
      PlotSeries& series = series_of(plot, m["name"]);
      series.points.push_back({m["of_full"].get<double>(), decibels});
      series.names.push_back(fmt::format("{}, {}, {}", scenario["scene"].get<std::string>(),
                                         scenario["rig"].get<std::string>(),
                                         scenario["course"].get<std::string>()));
    }
  write_svg(plot, file);
}

}  // namespace lenticule::bench
