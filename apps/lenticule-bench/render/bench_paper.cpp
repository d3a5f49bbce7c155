// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/render/bench_paper.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <numeric>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_scene.h"
#include "apps/lenticule-bench/harness/svg_plot.h"
#include "apps/lenticule-bench/render/bench_error.h"
#include "apps/lenticule-bench/render/bench_exact.h"
#include "base/error.h"
#include "base/file.h"
#include "base/print.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "render/methods/method.h"
#include "render/scene/scene.h"
#include "scenes/scene_list.h"

namespace lenticule::bench {

namespace {

double sum_of(const nlohmann::json& frames, const char* key) {
  const std::vector<double> values = values_of(frames, key);
  return std::accumulate(values.begin(), values.end(), 0.0);
}

}  // namespace

std::vector<PaperSpan> spans_of(const std::string& scene, int frames, int length, int spans) {
  const int most = (frames + length - 1) / length;
  const int count = spans == 0 ? most : std::min(spans, most);
  std::vector<PaperSpan> list;
  for (int i = 0; i < count; ++i) {
    // The middle of each of `count` equal parts.
    const int index = (2 * i + 1) * most / (2 * count);
    list.push_back({scene, index * length, std::min(length, frames - index * length)});
  }
  return list;
}

namespace {

/// Returns, per method over all frames of a scene's spans, which are measure_error()'s results with
/// "first": {"scene", "frames", "frames_of_sequence", "methods": [{"name", "frames": [...],
/// "cpu_seconds_per_frame", "build_seconds_per_frame", "traced", "missing", and what add_times()
/// and add_errors() add}]}; shares and savings are from 0 to 1, a PSNR is null if equal.
nlohmann::json summarize(const std::string& scene, const std::vector<nlohmann::json>& spans) {
  nlohmann::json methods = nlohmann::json::array();
  for (const nlohmann::json& span : spans)
    for (size_t m = 0; m < span["methods"].size(); ++m) {
      if (m == methods.size()) methods.push_back({{"name", span["methods"][m]["name"]}});
      for (const nlohmann::json& frame : span["methods"][m]["frames"])
        methods[m]["frames"].push_back(frame);
    }
  const nlohmann::json reference = methods[0]["frames"];
  for (nlohmann::json& method : methods) {
    const nlohmann::json& frames = method["frames"];
    add_times(method, reference);
    const double count = static_cast<double>(frames.size());
    const double subpixels = sum_of(frames, "subpixels");
    method["cpu_seconds_per_frame"] = sum_of(frames, "cpu_s") / count;
    method["build_seconds_per_frame"] = sum_of(frames, "build_s") / count;
    method["traced"] = sum_of(frames, "traced") / subpixels;
    method["missing"] = sum_of(frames, "missing") / subpixels;
    if (&method != &methods[0]) add_errors(method);
  }
  return {{"scene", scene},
          {"frames", reference.size()},
          {"frames_of_sequence", scenes::find_scene(scene).frames},
          {"methods", std::move(methods)}};
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
  const auto channels = figures["channel_mses"].get<std::vector<double>>();
  const double mean = figures["mse"];
  print_out("  {:>5} {:>10.2f} {:>7.2f} {:>9.2f} {:>7.2f} {:>7.2f} {:>7.2f} {:>7.2f} {:>7.2f}\n",
            published.frame, published.column, published.psnr_db, std::sqrt(published.column), mean,
            std::sqrt(mean), mean > 0.0 ? psnr_or_null(mean).get<double>() : INFINITY,
            std::sqrt(std::ranges::max(channels)),
            std::sqrt(figures["worst_view_mse"].get<double>()));
}

/// Returns the figures of a method for a frame of the scene; null if they were not measured.
const nlohmann::json* frame_of(const std::vector<nlohmann::json>& spans, const std::string& method,
                               int number) {
  for (const nlohmann::json& span : spans)
    for (const nlohmann::json& one : span["methods"]) {
      const int place = number - span["first"].get<int>();
      if (one["name"] == method && place >= 0 && place < static_cast<int>(one["frames"].size()))
        return &one["frames"][static_cast<size_t>(place)];
    }
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

namespace {

void print_quality_table(const std::vector<nlohmann::json>& teapot_spans) {
  print_out("table 1: teapot, hybrid against full\n");
  print_out("  {:>5} {:>10} {:>7} {:>9} {:>7} {:>7} {:>7} {:>7} {:>7}\n", "", "paper's", "", "its",
            "ours", "", "", "worst", "worst");
  print_out("  {:>5} {:>10} {:>7} {:>9} {:>7} {:>7} {:>7} {:>7} {:>7}\n", "frame", "\"RMSE\"",
            "PSNR", "root", "MSE", "RMSE", "PSNR", "channel", "view");
  bool any = false;
  for (const PublishedQuality& published : published_quality()) {
    const nlohmann::json* frame = frame_of(teapot_spans, "hybrid", published.frame);
    if (!frame) continue;
    print_quality_row(published, *frame);
    any = true;
  }
  if (!any) print_out("  none of its frames were rendered\n");
  print_out(
      "  The paper's PSNR agrees with its column if the column is the mean squared error (MSE);\n"
      "  the RMSE is its root. Worst channel and view: RMSE.\n\n");
}

void print_time_table(const nlohmann::json& summaries) {
  constexpr const char* kRow =
      "  {:<12} {:>6} {:>8} {:>8} | {:>6} {:>7} | {:>6} {:>7} | {:>8} {:>7} | {}\n";
  print_out("table 2: time saved against full, for whole sequences\n");
  print_out(kRow, "", "", "full, s", "", "lens-", "view", "inter-", "polate", "temporal", "hybrid",
            "Tachyon");
  print_out(kRow, "scene", "frames", "paper", "ours", "paper", "ours", "paper", "ours", "ours",
            "ours", "Mray/s");
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
              published(&PublishedTimes::interpolate_s), saved("interpolate"), saved("temporal"),
              saved("hybrid"), summary.value("tachyon", std::string("-")));
  }
  print_out(
      "  Ours: seconds per measured frame times the frames of the sequence; a saving below 0\n"
      "  takes longer than full. Tachyon: millions of primary rays a second, full beside it.\n\n");
}

void print_method_table(const nlohmann::json& summary) {
  print_out("{}: {} of {} frames measured\n", summary["scene"].get<std::string>(),
            summary["frames"].get<int>(), summary["frames_of_sequence"].get<int>());
  constexpr Column kColumns[] = {{"", "name"},
                                 {"ms/frame", "seconds_per_frame", "{:.2f}", 1e3},
                                 {"CPU ms", "cpu_seconds_per_frame", "{:.2f}", 1e3},
                                 {"build ms", "build_seconds_per_frame", "{:.2f}", 1e3},
                                 {"saved", "saved", "{:.0f} %", 100.0},
                                 {"rays", "rays_per_subpixel", "{:.2f}"},
                                 {"traced", "traced", "{:.1f} %", 100.0},
                                 {"missing", "missing", "{:.1f} %", 100.0},
                                 {"PSNR", "psnr_mean_db", "{:.1f}", 1.0, "equal"},
                                 {"worst frame", "psnr_worst_db", "{:.1f}", 1.0, "equal"},
                                 {"view", "worst_view_psnr_db", "{:.1f}", 1.0, "equal"},
                                 {"max", "max"},
                                 {"over 8", "share_over_8", "{:.2f} %", 100.0},
                                 {"over 32", "share_over_32", "{:.2f} %", 100.0}};
  print_table(summary["methods"], kColumns, "  ");
  print_out("\n");
}

void plot_summary(const nlohmann::json& summary, const std::string& folder) {
  Plot plot{.title = fmt::format("{}: time against error", summary["scene"].get<std::string>()),
            .x = {.label = "milliseconds per frame"},
            .y = {.label = "RMSE of the mean PSNR, code values"},
            .series = {}};
  for (const nlohmann::json& m : summary["methods"]) {
    const nlohmann::json psnr = m.value("psnr_mean_db", nlohmann::json());
    const double rmse = psnr.is_null() ? 0.0 : 255.0 * std::pow(10.0, -psnr.get<double>() / 20.0);
    plot.series.push_back({m["name"], {{1e3 * m["seconds_per_frame"].get<double>(), rmse}}});
  }
  std::filesystem::create_directories(folder);
  const std::string name = fmt::format("paper-{}.svg", summary["scene"].get<std::string>());
  write_svg(plot, (std::filesystem::path(folder) / name).string());
}

// lenticule bench paper measures the methods of the paper on which this renderer is based, and
// prints the paper's two tables.

constexpr int kSpanLength = 16;
constexpr uint64_t kMostStateBytes = uint64_t{1} << 30;

struct PaperFlags : RunFlags {
  std::vector<std::string> scenes;
  std::vector<std::string> methods;
  int depth = 5;
  int spans = 0;
  bool quick = false;
  bool no_peers = false;
  std::string state;
  std::string plots;
};

std::vector<std::string> paper_scenes() {
  std::vector<std::string> names;
  for (const PublishedTimes& times : published_times()) names.emplace_back(times.scene);
  return names;
}

/// Returns the spans, always including the frames of the paper's first table. Quick spans end
/// early, so that methods that keep frames trace one of eight frames whole instead of one of
/// sixteen.
std::vector<PaperSpan> chosen_spans(const PaperFlags& flags, const std::string& scene) {
  constexpr int kQuickFrames = 8;
  const int frames = scenes::find_scene(scene).frames;
  const int spans = flags.spans == 0 && flags.quick ? 1 : flags.spans;
  std::vector<PaperSpan> list = spans_of(scene, frames, kSpanLength, spans);
  if (flags.quick)
    for (PaperSpan& span : list) span.count = std::min(span.count, kQuickFrames);
  if (scene != "teapot" || spans == 0) return list;
  const int first = published_quality().front().frame / kSpanLength * kSpanLength;
  const int last = published_quality().back().frame;
  list.front() = {scene, first, flags.quick ? last + 1 - first : kSpanLength};
  return list;
}

/// PaperState stores measured spans, in a file if one is named, so that a long run can be
/// continued.
class PaperState {
 public:
  /// Throws Error(Input) if the file exists and was not written by a run with the same settings.
  PaperState(std::string file, nlohmann::json settings) : file_(std::move(file)) {
    content_ = {{"settings", std::move(settings)}, {"spans", nlohmann::json::object()}};
    if (!file_.empty() && std::filesystem::exists(file_)) load();
  }

  [[nodiscard]] const nlohmann::json* find(const std::string& key) const {
    const auto found = content_["spans"].find(key);
    return found == content_["spans"].end() ? nullptr : &*found;
  }
  void keep(const std::string& key, const nlohmann::json& measured) {
    content_["spans"][key] = measured;
    if (file_.empty()) return;
    const std::string text = content_.dump(1) + "\n";
    write_file_atomically(file_, {reinterpret_cast<const uint8_t*>(text.data()), text.size()});
  }

 private:
  void load() {
    const std::vector<uint8_t> bytes = read_whole_file(file_, kMostStateBytes);
    const nlohmann::json known = nlohmann::json::parse(bytes, nullptr, false);
    if (!known.is_object() || !known.contains("settings") || !known.contains("spans") ||
        !known["spans"].is_object())
      throw Error(ErrorKind::Input, file_ + ": not a state file of bench paper");
    if (known["settings"] != content_["settings"])
      throw Error(ErrorKind::Input, file_ + ": the state file is of a run with other settings",
                  "use another file, or delete this one");
    content_ = known;
  }

  std::string file_;
  nlohmann::json content_;
};

class PaperRun {
 public:
  explicit PaperRun(const PaperFlags& flags)
      : flags_(flags),
        rig_(flags.rig.empty() ? lab::paper_rig() : optics::load_trimmed_rig(flags.rig)),
        state_(flags.state, settings()) {}

  ExitCode run() {
    std::vector<std::vector<PaperSpan>> spans;
    uint64_t frames = 0;
    for (const std::string& scene : flags_.scenes) {
      spans.push_back(chosen_spans(flags_, scene));
      for (const PaperSpan& span : spans.back()) frames += static_cast<uint64_t>(span.count);
    }
    player::Progress progress("paper", "frames", frames);
    for (size_t i = 0; i < spans.size() && !player::interrupted(); ++i) measure(spans[i], progress);
    progress.finish();
    if (!flags_.no_peers) add_peers();
    if (player::interrupted()) return player::interrupt_exit_code();
    report();
    return kOk;
  }

 private:
  [[nodiscard]] nlohmann::json settings() const {
    return {{"machine", machine_json()},    {"rig", optics::fingerprint(rig_)},
            {"methods", flags_.methods},    {"threads", flags_.threads},
            {"depth", flags_.depth},        {"runs", flags_.runs},
            {"version", LENTICULE_VERSION}, {"format", 2}};
  }

  /// Renders every frame of the span with every method, interleaved, and compares it with the
  /// reference. Null if interrupted.
  [[nodiscard]] nlohmann::json measure_span(const PaperSpan& span,
                                            const std::function<void()>& frame_done) const {
    ErrorSetup setup{.rig = rig_,
                     .entrants = {},
                     .frames = span.count,
                     .threads = flags_.threads,
                     .depth = flags_.depth,
                     .runs = flags_.runs,
                     .first = span.first,
                     .eyes = false};
    for (const std::string& name : flags_.methods)
      setup.entrants.push_back({.name = name, .method = name, .tolerated = {}});
    size_t renders = 0;
    nlohmann::json measured = measure_error(setup, ErrorScene(span.scene), [&] {
      if (++renders % setup.entrants.size() == 0) frame_done();
    });
    if (!measured.is_null()) measured["first"] = span.first;
    return measured;
  }

  void measure(const std::vector<PaperSpan>& spans, player::Progress& progress) {
    std::vector<nlohmann::json> measured;
    for (const PaperSpan& span : spans) {
      const std::string key = fmt::format("{}/{}+{}", span.scene, span.first, span.count);
      const nlohmann::json* known = state_.find(key);
      const auto step = [&] { progress.update(++frames_done_, span.scene); };
      nlohmann::json figures = known ? *known : measure_span(span, step);
      if (figures.is_null()) return;
      if (known)
        for (int i = 0; i < span.count; ++i) step();
      else
        state_.keep(key, figures);
      measured.push_back(std::move(figures));
    }
    summaries_.push_back(summarize(spans.front().scene, measured));
    if (spans.front().scene == "teapot") teapot_ = std::move(measured);
  }

  void add_peers() {
    for (nlohmann::json& summary : summaries_) {
      if (player::interrupted()) return;
      summary["tachyon"] = tachyon_rate(summary["scene"]);
    }
  }

  [[nodiscard]] std::string tachyon_rate(const std::string& scene) const {
    ExactFlags flags;
    flags.rig_instead = rig_;
    flags.depth = flags_.depth;
    flags.lights = 0;
    flags.runs = flags_.runs;
    flags.threads = flags_.threads;
    flags.peer_limit_s = 60;
    const nlohmann::json measured = measure_peers(flags, bench_scene_name(scene));
    const nlohmann::json& row = measured["rows"][0];
    if (!row.contains("mray_s")) return row.value("failure", "-");
    return fmt::format("{:.2f} ({:.2f} ours)", row["mray_s"].get<double>(),
                       measured["ours_mray_s"].get<double>());
  }

  void report() const {
    if (!flags_.plots.empty())
      for (const nlohmann::json& summary : summaries_) plot_summary(summary, flags_.plots);
    if (flags_.json) {
      print_json({{"machine", machine_json()},
                  {"rig", rig_.name},
                  {"runs", flags_.runs},
                  {"scenes", summaries_},
                  {"teapot", teapot_}});
      return;
    }
    print_out("machine   {}\nrig       {}, {}x{}\n", machine_text(), rig_.name, rig_.panel.width_px,
              rig_.panel.height_px);
    print_out(
        "frames    spans of {} consecutive frames, medians of {} interleaved run(s); the time to "
        "rebuild the scene is shown separately\n\n",
        flags_.quick ? "8 to 14" : "16", flags_.runs);
    for (const nlohmann::json& summary : summaries_) print_method_table(summary);
    if (!teapot_.empty()) print_quality_table(teapot_);
    print_time_table(summaries_);
  }

  const PaperFlags& flags_;
  optics::Rig rig_;
  PaperState state_;
  uint64_t frames_done_ = 0;
  nlohmann::json summaries_ = nlohmann::json::array();
  std::vector<nlohmann::json> teapot_;
};

void check(PaperFlags& flags) {
  for (const std::string& scene : flags.scenes) (void)scenes::find_scene(scene);
  // The reference is first.
  std::erase(flags.methods, "full");
  flags.methods.insert(flags.methods.begin(), "full");
  const auto& known = render::method_names();
  for (const std::string& name : flags.methods)
    if (std::ranges::find(known, name) == known.end())
      throw Error(ErrorKind::Usage, fmt::format("--method '{}': unknown", name),
                  fmt::format("this build has: {}", fmt::join(known, ", ")));
}

}  // namespace

cli::Run declare_bench_paper(CLI::App& app) {
  auto flags = std::make_shared<PaperFlags>();
  flags->runs = 3;
  flags->scenes = paper_scenes();
  flags->methods = render::method_names();
  app.add_option("--scene", flags->scenes, "a built-in scene; repeatable")->capture_default_str();
  app.add_option("--method", flags->methods, "methods beside full; repeatable")
      ->capture_default_str();
  declare_run_flags(app, *flags);
  app.get_option("--rig")->description("rig file (default: 64 upright lenses of 8 pixels)");
  app.add_flag(
      "--quick", flags->quick,
      "measure eight frames of each scene in one run, fourteen of the teapot: some minutes");
  app.add_option("--spans", flags->spans,
                 "number of evenly spaced spans of 16 frames; 0 measures whole sequences")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  declare_depth(app, "--depth", flags->depth);
  const CLI::Option* runs = app.get_option("--runs")->description(
      "number of interleaved runs; medians are reported; 1 with --quick");
  declare_threads(app, flags->threads);
  app.add_flag("--no-peers", flags->no_peers,
               "leave out Tachyon (scripts/packages bench installs it)");
  app.add_option("--state", flags->state,
                 "file for intermediate results; a later run continues from it");
  app.add_option("--plots", flags->plots, "folder for plots of time against error as SVG");
  return [flags, runs]() -> ExitCode {
    check(*flags);
    if (flags->quick && runs->empty()) flags->runs = 1;
    return PaperRun(*flags).run();
  };
}
}  // namespace lenticule::bench
