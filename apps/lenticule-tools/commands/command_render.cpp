// SPDX-License-Identifier: Apache-2.0
// lenticule render renders a scene into woven frames.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <thread>

#include "apps/lenticule-tools/cli/render_flags.h"
#include "apps/lenticule-tools/offline/film_renderer.h"
#include "apps/lenticule-tools/offline/frame_output.h"
#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/option.h"
#include "base/error_kinds.h"
#include "base/print.h"
#include "optics/rig_file.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "player/sources/source_spec.h"

namespace lenticule::tools {
namespace {

struct RenderCommandFlags {
  RenderFlags render;
  std::string rig_store;
  std::string output;
  std::string missing;
  double ring_timeout = 10.0;
  std::optional<double> adapt_rate{};  ///< frames per second for which the error is adapted
  bool resume = false;
  bool overwrite = false;
  bool json = false;
};

/// Totals of one run.
struct RunTotals {
  uint64_t rendered = 0;
  uint64_t skipped = 0;
  uint64_t again = 0;  ///< rendered because later frames need them, and not written
  render::RenderStatistics rays;
  double seconds = 0.0;

  void add(const render::RenderStatistics& frame, bool is_again) {
    ++(is_again ? again : rendered);
    rays.add(frame);
  }
};

/// Checks limits that the parser does not know.
void check_flags(const RenderCommandFlags& flags) {
  if (!(flags.ring_timeout >= 0.0) || flags.ring_timeout > 86400.0)
    throw Error(ErrorKind::Usage, "--ring-timeout: not between 0 and 86400 seconds");
  if (!flags.render.wall.empty() && !flags.missing.empty())
    throw Error(ErrorKind::Usage, "--missing: not supported for walls",
                "render one panel of it with --rig");
}

/// Checks the flags that --adapt-error needs.
void check_adapting(const RenderCommandFlags& flags, bool error_given) {
  if (error_given)
    throw Error(ErrorKind::Usage, "--adapt-error: chooses the error that --error or --psnr fixes",
                "give one of them");
  if (flags.render.method != "adaptive")
    throw usage_error("--adapt-error: method {} tolerates no error", flags.render.method)
        .remedy("--method adaptive does");
  if (player::parse_source(flags.output).kind != player::SourceKind::Ring)
    throw Error(ErrorKind::Usage,
                "--adapt-error: files are not live, and would depend on the machine's speed",
                "give --error, or a ring: -o ring:SOCKET");
}

/// AdaptedError chooses the error of each frame of a live renderer, and remembers which it chose.
class AdaptedError {
 public:
  /// Throws Error(Usage) for a rate out of range.
  explicit AdaptedError(double frames_per_s) : rate_(frames_per_s), controller_(frames_per_s) {}

  /// Prepares the next frame. Throws Error(Usage) if the method tolerates no error on this rig.
  void begin(FilmRenderer& film) {
    error_ = controller_.error();
    start_ = Clock::now();
    if (!film.set_tolerated_error(error_))
      throw Error(ErrorKind::Usage,
                  "--adapt-error: method adaptive renders frames of this rig with method full",
                  "leave out --adapt-error");
  }
  /// Reports that the frame is rendered.
  void end() {
    const std::chrono::duration<double> elapsed = Clock::now() - start_;
    controller_.add_frame(elapsed.count());
    seconds_ += elapsed.count();
    ++frames_;
    least_ = frames_ == 1 ? error_ : std::min(least_, error_);
    most_ = std::max(most_, error_);
  }

  [[nodiscard]] nlohmann::json json() const {
    return {{"frames_per_s", rate_},
            {"least_error", least_},
            {"most_error", most_},
            {"last_error", error_}};
  }
  void report() const {
    if (frames_ == 0) return;
    say("tolerated error: {:.2f} to {:.2f} code values, {:.2f} at the end; rendering alone reached "
        "{:.2f} frames/s\n",
        least_, most_, error_, static_cast<double>(frames_) / seconds_);
  }

 private:
  using Clock = std::chrono::steady_clock;

  double rate_;
  ErrorController controller_;
  Clock::time_point start_;
  double error_ = 0.0, least_ = 0.0, most_ = 0.0;
  double seconds_ = 0.0;
  uint64_t frames_ = 0;
};

nlohmann::json stage_json(const render::Stage& stage) {
  return {{"mm_per_unit", stage.mm_per_unit},
          {"depth_scale", stage.depth_scale},
          {"near_mm", finite_or_null(stage.near_mm)},
          {"far_mm", finite_or_null(stage.far_mm)},
          {"subject_near_mm", finite_or_null(stage.subject_mm.high)},
          {"subject_far_mm", finite_or_null(stage.subject_mm.low)},
          {"depth_of_field_mm", finite_or_null(stage.depth_of_field_mm)}};
}

nlohmann::json result_json(const RenderCommandFlags& command, const FilmRenderer& film,
                           const std::string& output, const RunTotals& totals) {
  const RenderFlags& flags = command.render;
  const optics::Rig& rig = film.rig();
  nlohmann::json json = {{"scene", flags.scene},
                         {"rig_fingerprint", optics::fingerprint(rig)},
                         {"method", flags.method},
                         {"samples", flags.options.samples},
                         {"prefilter", flags.prefilter},
                         {"output", output},
                         {"width", rig.panel.width_px},
                         {"height", rig.panel.height_px},
                         {"frames_rendered", totals.rendered},
                         {"frames_skipped", totals.skipped},
                         {"interrupted", player::interrupted()},
                         {"seconds", totals.seconds},
                         {"render_seconds", totals.rays.seconds},
                         {"frames_rendered_again", totals.again},
                         {"beyond_bound", totals.rays.beyond_bound},
                         {"audited_rmse", totals.rays.audited_rmse},
                         {"rmse_bound", totals.rays.rmse_bound},
                         {"stage", stage_json(film.reference_stage())}};
  if (film.panel().in_wall())
    json.update({{"wall", command.render.wall}, {"panel", film.panel().name}});
  else
    json["rig"] = flags.rig;
  for (const render::FrameCounter& counter : render::kFrameCounters)
    json[counter.name] = totals.rays.*counter.field;
  return json;
}

/// Returns the number of threads: all cores, less one if a player on this machine takes the frames
/// and there are enough cores, because the player must wake up in time for every refresh.
int threads_of(const RenderCommandFlags& flags) {
  constexpr int kFewCores = 4;
  const int threads = flags.render.options.threads;
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  const bool beside_player = player::parse_source(flags.output).kind == player::SourceKind::Ring;
  return threads == 0 && beside_player && cores >= kFewCores ? cores - 1 : threads;
}

/// RenderRun renders the film of one panel into `target`.
class RenderRun {
 public:
  RenderRun(const RenderCommandFlags& flags, FilmPanel panel, std::string target)
      : flags_(flags),
        target_(std::move(target)),
        adapted_(flags.adapt_rate ? std::make_optional<AdaptedError>(*flags.adapt_rate)
                                  : std::nullopt),
        range_(player::parse_frame_range(flags.render.frames)),
        film_(flags.render, std::move(panel), range_, !flags.missing.empty()),
        output_(open_output(output_request(target_))) {
    if (flags.missing.empty()) return;
    if (film_.method().missing_subpixels() == nullptr)
      throw usage_error("--missing: method {} leaves no subpixel empty", flags.render.method);
    missing_ = open_output(output_request(flags.missing));
  }

  ExitCode run() {
    const auto start = std::chrono::steady_clock::now();
    player::say_at_interrupt("\nfinishing this frame; Ctrl-C again stops at once\n");
    frames::WovenFrame frame(film_.geometry());
    player::Progress progress("render", "frames", range_.count());
    for (uint64_t number = range_.begin; number < range_.end && !player::interrupted(); ++number) {
      if (flags_.resume && output_->has(number)) {
        ++totals_.skipped;
      } else if (!render_and_deliver(number, frame)) {
        break;
      }
      progress.update(number - range_.begin + 1, note(), totals_.skipped);
    }
    if (!player::interrupted()) output_->finish();
    progress.finish(note());
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    totals_.seconds = elapsed.count();
    report();
    say_how_to_resume(target_);
    return player::interrupt_exit_code();
  }

  [[nodiscard]] nlohmann::json result() const {
    nlohmann::json json = result_json(flags_, film_, target_, totals_);
    if (adapted_) json["adapted_error"] = adapted_->json();
    return json;
  }

 private:
  [[nodiscard]] OutputRequest output_request(const std::string& target) const {
    OutputRequest request = film_.output_request(target, range_);
    request.ring_timeout_seconds = flags_.ring_timeout;
    request.resume = flags_.resume;
    request.overwrite = flags_.overwrite;
    return request;
  }

  /// Renders and delivers a frame; returns false if interrupted.
  bool render_and_deliver(uint64_t number, frames::WovenFrame& frame) {
    const auto count = [this](const render::RenderStatistics& statistics, bool again) {
      totals_.add(statistics, again);
    };
    if (adapted_) adapted_->begin(film_);
    if (!film_.render(number, frame, player::interrupted, count)) return false;
    if (adapted_) adapted_->end();
    if (!output_->deliver(number, frame.view())) return false;
    return !missing_ || missing_->deliver(number, film_.method().missing_subpixels()->view());
  }

  [[nodiscard]] std::string note() const {
    const double frames = static_cast<double>(totals_.rendered + totals_.again);
    return totals_.rendered == 0 ? std::string()
                                 : fmt::format("{:.2f} s/frame", totals_.rays.seconds / frames);
  }

  void report() const {
    if (adapted_) adapted_->report();
    if (totals_.rays.invalid_rays > 0)
      say("{} rays were not finite and are black\n", totals_.rays.invalid_rays);
    report_reuse();
  }

  void report_reuse() const {
    const render::RenderStatistics& s = totals_.rays;
    if (s.projected_subpixels + s.interpolated_subpixels == 0) {
      if (flags_.render.method == "adaptive" && s.traced_subpixels > 0)
        say("subpixels: all from method full, {}\n", flags_.render.options.tolerated_error == 0.0
                                                         ? "as --error 0 asks"
                                                         : "which is as fast here");
      return;
    }
    const auto percent = [&s](uint64_t count) {
      return 100.0 * static_cast<double>(count) / static_cast<double>(s.subpixels);
    };
    if (s.audited_subpixels > 0) return report_audit(percent(s.traced_subpixels));
    say("subpixels: {:.1f} % traced, {:.1f} % reprojected, {:.1f} % interpolated; {:.1f} % were "
        "missing after reprojection\n",
        percent(s.traced_subpixels), percent(s.projected_subpixels),
        percent(s.interpolated_subpixels), percent(s.missing_subpixels));
  }

  void report_audit(double shaded_percent) const {
    const render::RenderStatistics& s = totals_.rays;
    const std::string tolerated =
        adapted_ ? "their frame's error"
                 : fmt::format("{:g} code values", flags_.render.options.tolerated_error);
    say("subpixels: {:.1f} % shaded individually; of {} sampled and traced, {} were off by more "
        "than {}; in no frame more than {:.2g} % of all (99.99 % confidence)\n",
        shaded_percent, s.audited_subpixels, s.audited_beyond, tolerated, 100.0 * s.beyond_bound);
    if (s.rmse_bound > 0.0)
      say("RMSE of the worst frame: at most {:.2f} code values or {:.1f} dB (99 % confidence); of "
          "the sampled subpixels {:.2f}\n",
          s.rmse_bound, 20.0 * std::log10(255.0 / s.rmse_bound), s.audited_rmse);
    else
      say("RMSE: 0; everything comes from method full\n");
    if (flags_.render.options.soft.any())
      say("these errors are those against finer soft light, without the noise of method full\n");
    if (s.retraced_subpixels > 0)
      say("{} subpixels were left to method full, where it is as fast or errors are too large\n",
          s.retraced_subpixels);
  }

  const RenderCommandFlags& flags_;
  std::string target_;
  std::optional<AdaptedError> adapted_;
  player::FrameRange range_;
  FilmRenderer film_;
  std::unique_ptr<FrameOutput> output_;
  std::unique_ptr<FrameOutput> missing_{};  ///< null unless requested
  RunTotals totals_;
};

ExitCode render_panel(const RenderCommandFlags& flags) {
  RenderRun run(flags, panel_of_rig(flags.render.rig), flags.output);
  const ExitCode code = run.run();
  if (flags.json) print_json(run.result());
  return code;
}

/// Renders the films of all panels of a wall, one after the other, or only that of --panel.
ExitCode render_wall(const RenderCommandFlags& flags) {
  const std::string& only = flags.render.panel;
  const optics::PlacedWall wall = optics::load_wall(flags.render.wall);
  std::vector<std::string> names;
  for (const optics::PlacedPanel& panel : wall.panels) names.push_back(panel.name);
  if (!only.empty()) names = {wall.panel(only).name};
  const bool to_ring = player::parse_source(flags.output).kind == player::SourceKind::Ring;
  nlohmann::json results = nlohmann::json::array();
  for (const std::string& name : names) {
    if (player::interrupted()) break;
    const bool keeps_target = to_ring && !only.empty();
    const std::string target = keeps_target ? flags.output : target_of_panel(flags.output, name);
    say("panel '{}': {}\n", name, target);
    RenderRun run(flags, panel_of_wall(wall, wall.panel(name)), target);
    (void)run.run();
    results.push_back(run.result());
  }
  if (flags.json) print_json({{"wall", flags.render.wall}, {"panels", results}});
  return player::interrupt_exit_code();
}

}  // namespace

cli::Run declare_render(CLI::App& app) {
  auto flags = std::make_shared<RenderCommandFlags>();
  const std::function<void()> complete = declare_render_flags(app, flags->render);
  cli::add_option(app, "-o,--output OUTPUT", flags->output,
                  "picture file, pattern ('out/%05d.png'), FILE.lts or ring:SOCKET")
      ->required();
  CLI::Option* const resume =
      app.add_flag("--resume", flags->resume, "skip frames that exist already");
  app.add_flag("--overwrite", flags->overwrite, kOverwriteHelp)->excludes(resume);
  app.add_flag("--json", flags->json, "print what was done as JSON");
  app.option_defaults()->group("Into a ring");
  cli::add_option(app, "--ring-timeout SECONDS", flags->ring_timeout,
                  "how long to wait for a player, including one that restarts");
  cli::add_option(app, "--adapt-error RATE", flags->adapt_rate,
                  "method adaptive: choose the error of each frame so that this rate holds\n"
                  "Of 0.5 to 16 code values, in frames per second.");
  cli::add_option(app, "--rig-store FILE", flags->rig_store,
                  "use this copy of the rig as long as a player with this flag does")
      ->needs(app.get_option("--rig"));
  cli::add_option(app, "--missing FILE", flags->missing,
                  "picture of the subpixels that reprojection left empty\n"
                  "A file or a pattern; they are white in it.")
      ->group("Quality");
  return [flags, complete, &app]() -> ExitCode {
    check_flags(*flags);
    if (flags->adapt_rate) check_adapting(*flags, app.count("--error") + app.count("--psnr") > 0);
    if (!flags->rig_store.empty())
      flags->render.rig = optics::RigStore(flags->render.rig, flags->rig_store).in_use().string();
    complete();
    flags->render.options.threads = threads_of(*flags);
    return flags->render.wall.empty() ? render_panel(*flags) : render_wall(*flags);
  };
}

}  // namespace lenticule::tools
