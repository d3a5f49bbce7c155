// SPDX-License-Identifier: Apache-2.0
// lenticule bench paper measures the methods of the paper on which this renderer is based, and
// prints the paper's two tables.
#include "apps/lenticule-bench/render/bench_paper.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/render/bench_exact.h"
#include "base/error.h"
#include "base/file.h"
#include "base/print.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "scenes/scene_list.h"

namespace lenticule::bench {
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
