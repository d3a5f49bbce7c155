// SPDX-License-Identifier: Apache-2.0
// lenticule bench exact --scaling and --growth measure how the cost grows with threads, subpixels,
// triangles, lights and the pitch of the lenses.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <thread>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_timing.h"
#include "apps/lenticule-bench/render/bench_exact.h"
#include "apps/lenticule-tools/cli/svg_plot.h"
#include "base/print.h"
#include "player/process/interrupt.h"

namespace lenticule::bench {
namespace {

using tools::AxisScale;

/// A series of setups; the growing quantity is read from the resulting scene.
struct Growth {
  const char* name;
  const char* x_label;
  AxisScale x_scale;
  double (*x_of)(const BenchScene& scene);
  std::vector<BenchSetup> steps;
};

void write_plot(const ExactFlags& flags, const std::string& name, const tools::Plot& plot) {
  if (!flags.plots.empty())
    write_svg(plot, (std::filesystem::path(flags.plots) / (name + ".svg")).string());
}

nlohmann::json row_of(double x, uint64_t subpixels, const CaseTimes& times) {
  return {{"x", x},
          {"subpixels", subpixels},
          {"visibility_ns", nanoseconds_each(subpixels, median(times.visibility))},
          {"frame_ns", nanoseconds_each(subpixels, median(times.frame))},
          {"frame_seconds", median(times.frame)},
          {"rays_per_subpixel", static_cast<double>(all_rays(times.statistics)) /
                                    static_cast<double>(std::max<uint64_t>(1, subpixels))}};
}

tools::PlotSeries series_of(const nlohmann::json& rows, const char* key, std::string label) {
  tools::PlotSeries series{.label = std::move(label), .points = {}};
  for (const auto& row : rows)
    series.points.push_back({row["x"].get<double>(), row[key].get<double>()});
  return series;
}

// ---- threads

std::vector<int> thread_counts() {
  const int all = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  std::vector<int> counts;
  for (int count = 1; count < all; count = all <= 8 ? count + 1 : 2 * count)
    counts.push_back(count);
  counts.push_back(all);
  return counts;
}

nlohmann::json scale_scene(const ExactFlags& flags, const std::string& name) {
  BenchScene bench(exact_setup(flags, name));
  const std::vector<int> counts = thread_counts();
  std::vector<TimedCase> cases;
  for (const int count : counts) {
    cases.push_back({.scene = &bench, .options = bench.options(flags.depth)});
    cases.back().options.threads = count;
  }
  const std::vector<CaseTimes> times = time_by_turns(cases, flags.runs);
  nlohmann::json rows = nlohmann::json::array();
  for (size_t i = 0; i < cases.size(); ++i) {
    rows.push_back(row_of(counts[i], bench.subpixels(), times[i]));
    const double seconds = rows.back()["frame_seconds"].get<double>();
    rows.back()["speed_up"] =
        seconds > 0.0 ? rows.front()["frame_seconds"].get<double>() / seconds : 0.0;
  }
  return {{"name", "threads"}, {"scene", name}, {"x_label", "threads"}, {"rows", std::move(rows)}};
}

// ---- growth

std::string built_in(const char* name, int size) {
  return fmt::format("builtin:{}:{}", name, size);
}

Growth subpixel_growth(const BenchSetup& base) {
  Growth growth{"subpixels",
                "subpixels of the panel",
                AxisScale::Log,
                [](const BenchScene& s) { return static_cast<double>(s.subpixels()); },
                {}};
  for (const int part : {8, 4, 2, 1}) {
    growth.steps.push_back(base);
    optics::Panel& panel = growth.steps.back().rig.panel;
    panel.width_px = std::max(1, panel.width_px / part);
    panel.height_px = std::max(1, panel.height_px / part);
  }
  return growth;
}

Growth triangle_growth(const BenchSetup& base) {
  Growth growth{"triangles",
                "triangles of the teapot and its board",
                AxisScale::Log,
                [](const BenchScene& s) { return static_cast<double>(s.primitives()); },
                {}};
  for (const int size : {4, 6, 10, 16, 25, 40}) {
    growth.steps.push_back(base);
    growth.steps.back().scene = built_in("teapot", size);
  }
  return growth;
}

Growth light_growth(const BenchSetup& base) {
  Growth growth{
      "lights",
      "lights of the tree",
      AxisScale::Linear,
      [](const BenchScene& s) { return static_cast<double>(s.description().lights.size()); },
      {}};
  for (int lights = 1; lights <= 7; ++lights) {
    growth.steps.push_back(base);
    growth.steps.back().scene = "builtin:tree";
    growth.steps.back().lights = lights;
  }
  return growth;
}

/// Varies the pitch with a constant cone of views: the gap grows with the pitch.
Growth pitch_growth(const BenchSetup& base) {
  Growth growth{"pitch",
                "subpixels per lens",
                AxisScale::Log,
                [](const BenchScene& s) { return s.setup().rig.sheet.pitch.value; },
                {}};
  for (const double factor : {0.5, 1.0, 2.0, 4.0, 8.0}) {
    growth.steps.push_back(base);
    optics::LensSheet& sheet = growth.steps.back().rig.sheet;
    sheet.pitch = sheet.pitch * factor;
    sheet.gap = sheet.gap * factor;
  }
  return growth;
}

nlohmann::json measure(const ExactFlags& flags, const Growth& growth) {
  std::vector<std::unique_ptr<BenchScene>> scenes;
  std::vector<TimedCase> cases;
  for (const BenchSetup& step : growth.steps) {
    scenes.push_back(std::make_unique<BenchScene>(step));
    cases.push_back({.scene = scenes.back().get(), .options = scenes.back()->options(flags.depth)});
  }
  const std::vector<CaseTimes> times = time_by_turns(cases, flags.runs);
  nlohmann::json rows = nlohmann::json::array();
  for (size_t i = 0; i < cases.size(); ++i)
    rows.push_back(row_of(growth.x_of(*scenes[i]), scenes[i]->subpixels(), times[i]));
  return {{"name", growth.name},
          {"scene", growth.steps.back().scene},
          {"x_label", growth.x_label},
          {"rows", std::move(rows)}};
}

void plot_growth(const ExactFlags& flags, const Growth& growth, const nlohmann::json& measured) {
  const auto& rows = measured["rows"];
  tools::Plot plot;
  plot.title = fmt::format("Cost per subpixel by {}", growth.name);
  plot.x = {.label = growth.x_label, .scale = growth.x_scale};
  // Proportional growth along a linear x axis is visible only with a linear y axis.
  plot.y = {.label = "ns per subpixel", .scale = growth.x_scale};
  plot.series = {series_of(rows, "frame_ns", "whole frame"),
                 series_of(rows, "visibility_ns", "visibility")};
  write_plot(flags, fmt::format("growth-{}", growth.name), plot);
}

}  // namespace

nlohmann::json measure_scaling(const ExactFlags& flags) {
  nlohmann::json all = nlohmann::json::array();
  tools::Plot plot;
  plot.title = "Speed-up of the whole frame";
  plot.x.label = "threads";
  plot.y.label = "times as fast as one thread";
  for (const std::string& scene : flags.scenes) {
    all.push_back(scale_scene(flags, bench_scene_name(scene)));
    if (player::interrupted()) return all;
    plot.series.push_back(series_of(all.back()["rows"], "speed_up", scene));
  }
  write_plot(flags, "scaling", plot);
  return all;
}

nlohmann::json measure_growth(const ExactFlags& flags) {
  const BenchSetup base = exact_setup(flags, "builtin:teapot");
  nlohmann::json all = nlohmann::json::array();
  for (const auto& make : {subpixel_growth, triangle_growth, light_growth, pitch_growth}) {
    const Growth growth = make(base);
    all.push_back(measure(flags, growth));
    if (player::interrupted()) return all;
    plot_growth(flags, growth, all.back());
  }
  return all;
}

void print_growth(const nlohmann::json& growth) {
  print_out("{}: {}\n", growth["name"].get<std::string>(), growth["scene"].get<std::string>());
  print_out("  {:>38} {:>14} {:>11} {:>9} {:>9}\n", growth["x_label"].get<std::string>(),
            "visibility ns", "frame ns", "frame s", "rays");
  for (const auto& row : growth["rows"]) {
    print_out("  {:>38.10g} {:>14.2f} {:>11.2f} {:>9.3f} {:>9.2f}", row["x"].get<double>(),
              row["visibility_ns"].get<double>(), row["frame_ns"].get<double>(),
              row["frame_seconds"].get<double>(), row["rays_per_subpixel"].get<double>());
    if (row.contains("speed_up")) print_out("   {:.2f} x", row["speed_up"].get<double>());
    print_out("\n");
  }
}

}  // namespace lenticule::bench
