// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/render/bench_paper.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_scene.h"
#include "apps/lenticule-bench/render/bench_exact.h"
#include "apps/lenticule-tools/cli/svg_plot.h"
#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "base/error.h"
#include "base/file.h"
#include "base/print.h"
#include "frames/compare.h"
#include "optics/model.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "render/make_method.h"
#include "render/scene/scene.h"
#include "scenes/scene_list.h"

namespace lenticule::bench {

namespace {

/// One method in one run; it may keep data of its last frame.
struct Contestant {
  std::unique_ptr<render::Method> method;
  frames::WovenFrame frame;
};

/// The measurements of all runs of one method for one frame.
struct Taken {
  std::vector<double> wall_s, cpu_s, build_s;
  render::RenderStatistics statistics;
};

class SpanRun {
 public:
  SpanRun(const PaperSetup& setup, const PaperSpan& span)
      : setup_(setup),
        model_(setup.rig),
        scene_(scenes::find_scene(span.scene)),
        stages_(tools::describe_built_in(scene_), model_, {}) {
    const frames::FrameGeometry geometry{setup.rig.panel.width_px, setup.rig.panel.height_px,
                                         frames::PixelFormat::Rgb8};
    render::RenderOptions options;
    options.threads = setup.threads;
    options.max_depth = setup.depth;
    options.cancelled = [] { return player::interrupted(); };
    for (int run = 0; run < setup.runs; ++run)
      for (const std::string& name : setup.methods) {
        const PaperMethod one{name};
        options.reuse = one.literal() ? render::literal_reuse() : render::ReuseOptions{};
        contestants_.push_back(
            {render::make_method(one.method(), model_, options), frames::WovenFrame(geometry)});
      }
  }

  nlohmann::json frame(int number) {
    const render::SceneDescription description = tools::describe_built_in(scene_, {}, number);
    const render::Stage stage = stages_.at(description);
    std::vector<Taken> taken(setup_.methods.size());
    const size_t rounds = contestants_.size();
    for (size_t turn = 0; turn < rounds && !player::interrupted(); ++turn) {
      // Each frame starts with another method, because later ones find warmer caches.
      const size_t i = (turn + static_cast<size_t>(number)) % rounds;
      contestants_[i].method->set_frame(static_cast<uint64_t>(number));
      race(contestants_[i], description, stage, taken[i % setup_.methods.size()]);
    }
    nlohmann::json methods;
    for (size_t m = 0; m < setup_.methods.size(); ++m)
      methods[setup_.methods[m]] = figures(taken[m], m);
    return {{"frame", number}, {"methods", std::move(methods)}};
  }

 private:
  /// Renders one frame. Each method has its own scene, because results of culling are stored in the
  /// scene.
  void race(Contestant& one, const render::SceneDescription& description,
            const render::Stage& stage, Taken& taken) const {
    const double start = seconds_now();
    const render::Scene scene(description, stage, {}, setup_.threads);
    taken.build_s.push_back(seconds_now() - start);
    const double cpu = process_cpu_seconds();
    const double begin = seconds_now();
    taken.statistics = one.method->render(scene, stage, one.frame);
    taken.wall_s.push_back(seconds_now() - begin);
    taken.cpu_s.push_back(process_cpu_seconds() - cpu);
  }

  nlohmann::json figures(const Taken& taken, size_t m) const {
    const render::RenderStatistics& s = taken.statistics;
    nlohmann::json out = {
        {"wall_s", median(taken.wall_s)},     {"cpu_s", median(taken.cpu_s)},
        {"build_s", median(taken.build_s)},   {"rays", all_rays(s)},
        {"subpixels", s.subpixels},           {"traced", s.traced_subpixels},
        {"projected", s.projected_subpixels}, {"interpolated", s.interpolated_subpixels},
        {"missing", s.missing_subpixels}};
    if (m != 0) add_errors(contestants_[m].frame, out);
    return out;
  }

  void add_errors(const frames::WovenFrame& frame, nlohmann::json& out) const {
    const frames::FrameView reference = contestants_.front().frame.view();
    const frames::PictureDifference off = frames::compare_pictures(reference, frame.view());
    const std::vector<frames::Difference> views = frames::compare_views(
        reference, frame.view(), model_, frames::native_view_count(setup_.rig));
    out["mse"] = {off.channels[0].mse(), off.channels[1].mse(), off.channels[2].mse()};
    out["max"] = off.total.max();
    out["share_over_8"] = off.total.share_over(8);
    out["share_over_32"] = off.total.share_over(32);
    out["worst_view_mse"] = views[static_cast<size_t>(frames::worst_view(views))].mse();
  }

  const PaperSetup& setup_;
  optics::OpticalModel model_;
  const scenes::BuiltInScene& scene_;
  tools::StageSequence stages_;
  std::vector<Contestant> contestants_;  ///< run by run, in the order of the methods
};

double mean_of(const nlohmann::json& mse) {
  return (mse[0].get<double>() + mse[1].get<double>() + mse[2].get<double>()) / 3.0;
}

/// Sums of one method over all frames.
struct Sums {
  int frames = 0, differing = 0, max = 0, worst_frame = 0;
  double wall_s = 0, cpu_s = 0, build_s = 0, rays = 0, subpixels = 0, traced = 0, missing = 0;
  double psnr = 0, worst_mse = 0, worst_view_mse = 0, over_8 = 0, over_32 = 0;

  void add(int frame, const nlohmann::json& f) {
    ++frames;
    wall_s += f["wall_s"].get<double>();
    cpu_s += f["cpu_s"].get<double>();
    build_s += f["build_s"].get<double>();
    rays += f["rays"].get<double>();
    subpixels += f["subpixels"].get<double>();
    traced += f["traced"].get<double>();
    missing += f["missing"].get<double>();
    if (f.contains("mse")) add_errors(frame, f);
  }

  void add_errors(int frame, const nlohmann::json& f) {
    const double mse = mean_of(f["mse"]);
    if (mse > 0.0) {
      ++differing;
      psnr += 10.0 * std::log10(255.0 * 255.0 / mse);
    }
    if (mse > worst_mse) {
      worst_mse = mse;
      worst_frame = frame;
    }
    worst_view_mse = std::max(worst_view_mse, f["worst_view_mse"].get<double>());
    max = std::max(max, f["max"].get<int>());
    over_8 += f["share_over_8"].get<double>();
    over_32 += f["share_over_32"].get<double>();
  }
};

nlohmann::json figures_of(const std::string& name, const Sums& s, double reference_s) {
  return {{"name", name},
          {"seconds_per_frame", s.wall_s / s.frames},
          {"cpu_seconds_per_frame", s.cpu_s / s.frames},
          {"build_seconds_per_frame", s.build_s / s.frames},
          {"saved", reference_s > 0.0 ? 1.0 - s.wall_s / reference_s : 0.0},
          {"rays_per_subpixel", s.rays / s.subpixels},
          {"traced", s.traced / s.subpixels},
          {"missing", s.missing / s.subpixels},
          {"psnr_mean_db", s.differing > 0 ? nlohmann::json(s.psnr / s.differing) : nullptr},
          {"psnr_worst_db", psnr_or_null(s.worst_mse)},
          {"worst_frame", s.worst_frame},
          {"worst_view_psnr_db", psnr_or_null(s.worst_view_mse)},
          {"max", s.max},
          {"share_over_8", s.over_8 / s.frames},
          {"share_over_32", s.over_32 / s.frames}};
}

}  // namespace

std::string PaperMethod::method() const {
  return literal() ? name.substr(0, name.size() - kLiteral.size()) : name;
}

const std::vector<std::string>& paper_method_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all = render::method_names();
    for (const char* of_the_paper : {"lens-view", "interpolate", "hybrid"})
      all.push_back(std::string(of_the_paper) + std::string(PaperMethod::kLiteral));
    return all;
  }();
  return names;
}

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

nlohmann::json measure_span(const PaperSetup& setup, const PaperSpan& span,
                            const std::function<void()>& done) {
  SpanRun run(setup, span);
  nlohmann::json frames = nlohmann::json::array();
  for (int i = 0; i < span.count; ++i) {
    frames.push_back(run.frame(span.first + i));
    if (player::interrupted()) return {};
    done();
  }
  return {{"scene", span.scene}, {"first", span.first}, {"frames", std::move(frames)}};
}

nlohmann::json summarize(const std::string& scene, const std::vector<nlohmann::json>& spans) {
  std::map<std::string, Sums> by_name;
  int frames = 0;
  for (const nlohmann::json& span : spans)
    for (const nlohmann::json& frame : span["frames"]) {
      ++frames;
      for (const auto& [name, figures] : frame["methods"].items())
        by_name[name].add(frame["frame"].get<int>(), figures);
    }
  const auto full = by_name.find("full");
  const double reference_s = full == by_name.end() ? 0.0 : full->second.wall_s;
  nlohmann::json methods = nlohmann::json::array();
  for (const std::string& name : paper_method_names())
    if (const auto found = by_name.find(name); found != by_name.end())
      methods.push_back(figures_of(name, found->second, reference_s));
  return {{"scene", scene},
          {"frames", frames},
          {"frames_of_sequence", scenes::find_scene(scene).frames},
          {"methods", std::move(methods)}};
}

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

// lenticule bench paper measures the methods of the paper on which this renderer is based, and
// prints the paper's two tables.

namespace {

constexpr int kSpanLength = 16;
constexpr uint64_t kMostStateBytes = uint64_t{1} << 30;

struct PaperFlags {
  std::vector<std::string> scenes;
  std::string rig;
  std::vector<std::string> methods;
  int threads = 0;
  int depth = 5;
  int runs = 3;
  int spans = 0;
  bool quick = false;
  bool no_peers = false;
  std::string state;
  std::string plots;
  bool json = false;
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
        setup_{.rig = flags.rig.empty() ? lab::paper_rig() : optics::load_trimmed_rig(flags.rig),
               .methods = flags.methods,
               .threads = flags.threads,
               .depth = flags.depth,
               .runs = flags.runs},
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
    return {{"machine", machine_json()},   {"rig", optics::fingerprint(setup_.rig)},
            {"methods", setup_.methods},   {"threads", setup_.threads},
            {"depth", setup_.depth},       {"runs", setup_.runs},
            {"version", LENTICULE_VERSION}};
  }

  void measure(const std::vector<PaperSpan>& spans, player::Progress& progress) {
    std::vector<nlohmann::json> measured;
    for (const PaperSpan& span : spans) {
      const std::string key = fmt::format("{}/{}+{}", span.scene, span.first, span.count);
      const nlohmann::json* known = state_.find(key);
      const auto step = [&] { progress.update(++frames_done_, span.scene); };
      nlohmann::json figures = known ? *known : measure_span(setup_, span, step);
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
    flags.rig = flags_.rig;
    flags.rig_instead = setup_.rig;
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
                  {"rig", setup_.rig.name},
                  {"runs", setup_.runs},
                  {"scenes", summaries_},
                  {"teapot", teapot_}});
      return;
    }
    print_out("machine   {}\nrig       {}, {}x{}\n", machine_text(), setup_.rig.name,
              setup_.rig.panel.width_px, setup_.rig.panel.height_px);
    print_out(
        "frames    spans of {} consecutive frames, medians of {} interleaved run(s); the time to "
        "rebuild the scene is shown separately\n\n",
        flags_.quick ? "8 to 14" : "16", setup_.runs);
    for (const nlohmann::json& summary : summaries_) print_method_table(summary);
    if (!teapot_.empty()) print_quality_table(teapot_);
    print_time_table(summaries_);
  }

  const PaperFlags& flags_;
  PaperSetup setup_;
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
  const auto& known = paper_method_names();
  for (const std::string& name : flags.methods)
    if (std::ranges::find(known, name) == known.end())
      throw Error(ErrorKind::Usage, fmt::format("--method '{}': unknown", name),
                  fmt::format("this build has: {}", fmt::join(known, ", ")));
}

}  // namespace

cli::Run declare_bench_paper(CLI::App& app) {
  auto flags = std::make_shared<PaperFlags>();
  flags->scenes = paper_scenes();
  flags->methods = paper_method_names();
  app.add_option("--scene", flags->scenes, "a built-in scene; repeatable")->capture_default_str();
  app.add_option("--method", flags->methods, "methods beside full; repeatable")
      ->capture_default_str();
  app.add_option("--rig", flags->rig, "rig file (default: 64 upright lenses of 8 pixels)");
  app.add_flag(
      "--quick", flags->quick,
      "measure eight frames of each scene in one run, fourteen of the teapot: some minutes");
  app.add_option("--spans", flags->spans,
                 "number of evenly spaced spans of 16 frames; 0 measures whole sequences")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  app.add_option("--depth", flags->depth, "number of bounces of mirrored and refracted rays")
      ->check(CLI::Range(0, 64))
      ->capture_default_str();
  const CLI::Option* runs =
      app.add_option("--runs", flags->runs, "number of runs; medians are reported; 1 with --quick")
          ->check(CLI::Range(1, 100))
          ->capture_default_str();
  app.add_option("--threads", flags->threads, "0 means all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_flag("--no-peers", flags->no_peers,
               "leave out Tachyon (scripts/packages bench installs it)");
  app.add_option("--state", flags->state,
                 "file for intermediate results; a later run continues from it");
  app.add_option("--plots", flags->plots, "folder for plots of time against error as SVG");
  app.add_flag("--json", flags->json, "print as JSON");
  return [flags, runs]() -> ExitCode {
    check(*flags);
    if (flags->quick && runs->empty()) flags->runs = 1;
    return PaperRun(*flags).run();
  };
}
}  // namespace lenticule::bench
