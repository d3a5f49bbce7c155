// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/render/bench_paper.h"
#include "apps/lenticule-tools/cli/svg_plot.h"
#include "base/print.h"

namespace lenticule::bench {
namespace {

double psnr_of(double mse) {
  return 10.0 * std::log10(255.0 * 255.0 / mse);
}

const nlohmann::json* method_of(const nlohmann::json& summary, const std::string& name) {
  for (const nlohmann::json& method : summary["methods"])
    if (method["name"] == name) return &method;
  return nullptr;
}

std::string saved_of(const nlohmann::json& summary, const std::string& name) {
  const nlohmann::json* method = method_of(summary, name);
  return method ? fmt::format("{:.0f} %", 100.0 * (*method)["saved"].get<double>()) : "-";
}

std::string published_saving(const PublishedTimes& times, double seconds) {
  return fmt::format("{:.0f} %", 100.0 * (1.0 - seconds / times.full_s));
}

/// Prints the error of one frame of the teapot, for the method in the paper's table.
void print_quality_row(const PublishedQuality& published, const nlohmann::json& figures) {
  const auto mse = [&](size_t c) { return figures["mse"][c].get<double>(); };
  const double mean = (mse(0) + mse(1) + mse(2)) / 3.0;
  print_out("  {:>5} {:>10.2f} {:>7.2f} {:>9.2f} {:>7.2f} {:>7.2f} {:>7.2f} {:>7.2f} {:>7.2f}\n",
            published.frame, published.column, published.psnr_db, std::sqrt(published.column), mean,
            std::sqrt(mean), mean > 0.0 ? psnr_of(mean) : INFINITY,
            std::sqrt(std::max({mse(0), mse(1), mse(2)})),
            std::sqrt(figures["worst_view_mse"].get<double>()));
}

const nlohmann::json* frame_of(const std::vector<nlohmann::json>& spans, int number) {
  for (const nlohmann::json& span : spans)
    for (const nlohmann::json& frame : span["frames"])
      if (frame["frame"] == number) return &frame;
  return nullptr;
}

}  // namespace

std::span<const PublishedTimes> published_times() {
  static constexpr std::array<PublishedTimes, 6> table = {{
      {"teapot", 612, 1836, 1040, 520},
      {"room", 634, 1268, 697, 496},
      {"small-balls", 421, 842, 379, 189},
      {"primitives", 512, 1024, 665, 333},
      {"tree", 612, 9017, 5202, 3672},
      {"gears", 612, 3060, 2570, 1224},
  }};
  return table;
}

std::span<const PublishedQuality> published_quality() {
  static constexpr std::array<PublishedQuality, 11> table = {{
      {99, 20.4630, 35.0211},
      {100, 23.8278, 34.3600},
      {101, 20.8956, 34.9303},
      {102, 24.3504, 34.2657},
      {103, 21.4394, 34.8187},
      {104, 24.7497, 34.1951},
      {105, 21.6736, 34.7715},
      {106, 25.3311, 34.0943},
      {107, 22.0668, 34.6934},
      {108, 25.7705, 34.0196},
      {109, 22.8951, 34.5334},
  }};
  return table;
}

void print_quality_table(const std::vector<nlohmann::json>& teapot_spans) {
  for (const char* method : {"hybrid", "hybrid-literal"}) {
    print_out("table 1: teapot, {} against full\n", method);
    print_out("  {:>5} {:>10} {:>7} {:>9} {:>7} {:>7} {:>7} {:>7} {:>7}\n", "", "paper's", "",
              "its", "ours", "", "", "worst", "worst");
    print_out("  {:>5} {:>10} {:>7} {:>9} {:>7} {:>7} {:>7} {:>7} {:>7}\n", "frame", "\"RMSE\"",
              "PSNR", "root", "MSE", "RMSE", "PSNR", "channel", "view");
    bool any = false;
    for (const PublishedQuality& published : published_quality()) {
      const nlohmann::json* frame = frame_of(teapot_spans, published.frame);
      if (!frame || !(*frame)["methods"].contains(method)) continue;
      print_quality_row(published, (*frame)["methods"][method]);
      any = true;
    }
    if (!any) print_out("  none of its frames were rendered\n");
  }
  print_out(
      "  The paper's PSNR agrees with its column if the column is the mean squared error (MSE);\n"
      "  the RMSE is its root. Worst channel and view: RMSE.\n\n");
}

void print_time_table(const nlohmann::json& summaries) {
  constexpr const char* kRow =
      "  {:<12} {:>6} {:>8} {:>8} | {:>6} {:>7} {:>8} | {:>6} {:>7} {:>8} | {:>8} {:>7} {:>8} | "
      "{}\n";
  print_out("table 2: time saved against full, for whole sequences\n");
  print_out(kRow, "", "", "full, s", "", "lens-", "view", "", "inter-", "polate", "", "temporal",
            "hybrid", "", "Tachyon");
  print_out(kRow, "scene", "frames", "paper", "ours", "paper", "ours", "literal", "paper", "ours",
            "literal", "ours", "ours", "literal", "Mray/s");
  for (const nlohmann::json& summary : summaries) {
    const std::string scene = summary["scene"];
    const auto found = std::ranges::find_if(
        published_times(), [&](const PublishedTimes& times) { return scene == times.scene; });
    const bool known = found != published_times().end();
    const auto published = [&](double PublishedTimes::*seconds) {
      return known ? published_saving(*found, (*found).*seconds) : "-";
    };
    const auto saved = [&](const char* method) { return saved_of(summary, method); };
    const int frames = summary["frames_of_sequence"];
    const nlohmann::json* full = method_of(summary, "full");
    print_out(kRow, scene, frames, known ? fmt::format("{:.0f}", found->full_s) : "-",
              fmt::format("{:.1f}", (*full)["seconds_per_frame"].get<double>() * frames),
              published(&PublishedTimes::lens_view_s), saved("lens-view"),
              saved("lens-view-literal"), published(&PublishedTimes::interpolate_s),
              saved("interpolate"), saved("interpolate-literal"), saved("temporal"),
              saved("hybrid"), saved("hybrid-literal"), summary.value("tachyon", std::string("-")));
  }
  print_out(
      "  Ours: seconds per measured frame times the frames of the sequence; a saving below 0\n"
      "  takes longer than full. Tachyon: millions of primary rays a second, full beside it.\n\n");
}

void print_method_table(const nlohmann::json& summary) {
  print_out("{}: {} of {} frames measured\n", summary["scene"].get<std::string>(),
            summary["frames"].get<int>(), summary["frames_of_sequence"].get<int>());
  print_out(
      "  {:<19} {:>9} {:>9} {:>9} {:>6} {:>6} {:>7} {:>7} {:>6} {:>11} {:>6} {:>4} {:>7} {:>7}\n",
      "", "ms/frame", "CPU ms", "build ms", "saved", "rays", "traced", "missing", "PSNR",
      "worst frame", "view", "max", "over 8", "over 32");
  for (const nlohmann::json& m : summary["methods"]) {
    const auto number = [&m](const char* key) { return m[key].get<double>(); };
    print_out("  {:<19} {:>9.2f} {:>9.2f} {:>9.2f} {:>4.0f} % {:>6.2f} {:>5.1f} % {:>5.1f} % ",
              m["name"].get<std::string>(), 1e3 * number("seconds_per_frame"),
              1e3 * number("cpu_seconds_per_frame"), 1e3 * number("build_seconds_per_frame"),
              100 * number("saved"), number("rays_per_subpixel"), 100 * number("traced"),
              100 * number("missing"));
    if (m["name"] == "full")
      print_out("{:>6}\n", "-");
    else
      print_out("{:>6} {:>11} {:>6} {:>4} {:>5.2f} % {:>5.2f} %\n", decibels(m["psnr_mean_db"]),
                decibels(m["psnr_worst_db"]), decibels(m["worst_view_psnr_db"]),
                m["max"].get<int>(), 100 * number("share_over_8"), 100 * number("share_over_32"));
  }
  print_out("\n");
}

void plot_summary(const nlohmann::json& summary, const std::string& folder) {
  tools::Plot plot{
      .title = fmt::format("{}: time against error", summary["scene"].get<std::string>()),
      .x = {.label = "milliseconds per frame"},
      .y = {.label = "RMSE of the mean PSNR, code values"},
      .series = {}};
  for (const nlohmann::json& m : summary["methods"]) {
    const double rmse = m["psnr_mean_db"].is_null()
                            ? 0.0
                            : 255.0 * std::pow(10.0, -m["psnr_mean_db"].get<double>() / 20.0);
    plot.series.push_back({m["name"], {{1e3 * m["seconds_per_frame"].get<double>(), rmse}}});
  }
  std::filesystem::create_directories(folder);
  const std::string name = fmt::format("paper-{}.svg", summary["scene"].get<std::string>());
  write_svg(plot, (std::filesystem::path(folder) / name).string());
}

}  // namespace lenticule::bench
