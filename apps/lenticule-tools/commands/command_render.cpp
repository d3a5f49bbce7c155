// SPDX-License-Identifier: Apache-2.0
// lenticule render renders a scene into woven frames.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <memory>
#include <optional>
#include <thread>

#include "apps/lenticule-tools/cli/soft_light_flags.h"
#include "apps/lenticule-tools/cli/staging_flags.h"
#include "apps/lenticule-tools/offline/existing_output.h"
#include "apps/lenticule-tools/offline/frame_output.h"
#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "apps/lenticule/cli/command.h"
#include "base/print.h"
#include "optics/rig_file.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "player/sources/source_spec.h"
#include "render/depth_budget/prefilter.h"
#include "render/loaders/camera_path.h"
#include "render/make_method.h"
#include "render/scene/nothing_seen.h"

namespace lenticule::player {
namespace {

struct RenderFlags {
  std::string scene;
  std::string rig;
  std::string method = "full";
  std::string frames = "0:1";
  std::string fps = "30";
  std::string camera;
  std::string output;
  std::string missing;
  render::RenderOptions options;
  StagingFlags staging;
  std::string prefilter = "off";
  double ring_timeout = 10.0;
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

  void add(const render::RenderStatistics& frame) {
    ++rendered;
    rays.add(frame);
  }
};

/// Checks limits that the parser does not know.
void complete(RenderFlags& flags) {
  flags.options.prefilter = render::prefilter_named(flags.prefilter);
  if (!(flags.ring_timeout >= 0.0) || flags.ring_timeout > 86400.0)
    throw Error(ErrorKind::Usage, "--ring-timeout: not between 0 and 86400 seconds");
}

/// Refuses flags that would have no effect. `error` and `prefilter_samples` tell whether the flags
/// of these names were given.
void refuse_idle_flags(const RenderFlags& flags, bool error, bool prefilter_samples) {
  if (error && flags.method != "adaptive")
    throw Error(ErrorKind::Usage, fmt::format("--error: method {} tolerates none", flags.method),
                "--method adaptive does");
  if (prefilter_samples && flags.options.prefilter == render::Prefilter::Off)
    throw Error(ErrorKind::Usage, "--prefilter-samples: nothing is averaged without --prefilter",
                "for example --prefilter beam");
  if (flags.staging.stage.ignore_cameras && !flags.camera.empty())
    throw Error(ErrorKind::Usage, "--fit: ignores the camera that --camera names",
                "give one of the two");
  if (flags.staging.turned_by_degrees != 0.0 && parse_frame_range(flags.frames).count() == 1)
    throw Error(ErrorKind::Usage, "--turn: one frame cannot turn from one angle to another",
                "for example --turn 0:360 --frames 0:48, or --turn 30");
}

void print_stage(const render::Stage& stage) {
  say("stage: {:.4g} mm per unit, depth {:.3g} times; ", stage.mm_per_unit, stage.depth_scale);
  say("from {:.1f} mm in front of the panel to {:.1f} mm behind it; ", stage.near_mm,
      -stage.far_mm);
  say("sharp within {:.1f} mm\n", stage.depth_of_field_mm);
}

void print_notes(const render::SceneDescription& scene) {
  for (const std::string& note : scene.notes) say("{}: {}\n", scene.source, note);
}

nlohmann::json stage_json(const render::Stage& stage) {
  return {{"mm_per_unit", stage.mm_per_unit},
          {"depth_scale", stage.depth_scale},
          {"near_mm", finite_or_null(stage.near_mm)},
          {"far_mm", finite_or_null(stage.far_mm)},
          {"depth_of_field_mm", finite_or_null(stage.depth_of_field_mm)}};
}

nlohmann::json result_json(const RenderFlags& flags, const optics::Rig& rig,
                           const render::Stage& stage, const RunTotals& totals) {
  nlohmann::json json = {{"scene", flags.scene},
                         {"rig", flags.rig},
                         {"rig_fingerprint", optics::fingerprint(rig)},
                         {"method", flags.method},
                         {"samples", flags.options.samples},
                         {"prefilter", flags.prefilter},
                         {"output", flags.output},
                         {"width", rig.panel.width_px},
                         {"height", rig.panel.height_px},
                         {"frames_rendered", totals.rendered},
                         {"frames_skipped", totals.skipped},
                         {"interrupted", interrupted()},
                         {"seconds", totals.seconds},
                         {"render_seconds", totals.rays.seconds},
                         {"frames_rendered_again", totals.again},
                         {"beyond_bound", totals.rays.beyond_bound},
                         {"stage", stage_json(stage)}};
  for (const render::FrameCounter& counter : render::kFrameCounters)
    json[counter.name] = totals.rays.*counter.field;
  return json;
}

/// Returns the number of threads: all cores, less one if a player on this machine takes the frames
/// and there are enough cores, because the player must wake up in time for every refresh.
int threads_of(const RenderFlags& flags) {
  constexpr int kFewCores = 4;
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  const bool beside_player = parse_source(flags.output).kind == SourceKind::Ring;
  return flags.options.threads == 0 && beside_player && cores >= kFewCores ? cores - 1
                                                                           : flags.options.threads;
}

/// Returns the scene of one frame, with the camera path's camera if there is one.
render::SceneDescription scene_of(const SceneSequence& scenes,
                                  const std::vector<render::Camera>& cameras, uint64_t frame) {
  render::SceneDescription scene = scenes.at(frame);
  // The camera stays at the last line of the path.
  if (!cameras.empty()) scene.cameras = {cameras[std::min<uint64_t>(frame, cameras.size() - 1)]};
  return scene;
}

class RenderRun {
 public:
  explicit RenderRun(const RenderFlags& flags)
      : flags_(flags),
        range_(parse_frame_range(flags.frames)),
        rate_(frames::parse_rate(flags.fps)),
        loaded_(optics::load_rig_and_identity(flags.rig)),
        model_(rig_),
        method_(render::make_method(flags.method, model_, options_of(flags))),
        scenes_(flags.scene, rate_, flags.staging.load) {
    if (!flags.camera.empty()) cameras_ = render::load_camera_path(flags.camera);
    scenes_.require(range_);
    const render::SceneDescription reference =
        scene_of(scenes_, cameras_, scenes_.reference_frame());
    print_notes(reference);
    stages_.emplace(reference, model_, flags.staging.stage, flags.staging.turned_by_degrees);
    print_stage(stages_->reference());
    require_content_in_view(still() ? reference : scene_of(scenes_, cameras_, range_.begin));
    output_ = open_output(output_request(flags.output));
    if (flags.missing.empty()) return;
    if (method_->missing_subpixels() == nullptr)
      throw Error(ErrorKind::Usage,
                  fmt::format("--missing: method {} leaves no subpixel empty", flags.method));
    missing_ = open_output(output_request(flags.missing));
  }

  ExitCode run() {
    const auto start = std::chrono::steady_clock::now();
    frames::WovenFrame frame(geometry());
    Progress progress("render", "frames", range_.count());
    for (uint64_t number = range_.begin; number < range_.end && !interrupted(); ++number) {
      if (flags_.resume && output_->has(number)) {
        ++totals_.skipped;
      } else if (!render_and_deliver(number, frame)) {
        break;
      }
      progress.update(number - range_.begin + 1, note());
    }
    if (!interrupted()) output_->finish();
    progress.finish(note());
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    totals_.seconds = elapsed.count();
    report();
    return interrupt_exit_code();
  }

 private:
  /// Refuses a scene of which the first frame shows nothing. If later frames may show it, or if
  /// there are surroundings to see, this is only noted.
  void require_content_in_view(const render::SceneDescription& first) const {
    const render::Stage stage = stages_->at(first);
    if (render::content_meets_rays(first, stage, model_)) return;
    const bool camera = render::placing_camera(first, flags_.staging.stage) != nullptr;
    const std::string what =
        fmt::format("nothing to see in this scene: all of it lies outside the {}",
                    camera ? "camera's view" : "panel");
    const render::Surroundings& around = flags_.staging.surroundings;
    const bool empty = still() && !around.sky && !around.ground && around.environment_file.empty();
    if (empty)
      throw Error(ErrorKind::Input, fmt::format("{}: {}", first.source, what),
                  camera ? "--fit ignores the camera and fits the whole scene into the panel"
                         : "render without --centre and --mm-per-unit, which fits it");
    say("{}: frame {}: {}\n", first.source, range_.begin, what);
  }

  /// Returns true if all frames are equal.
  [[nodiscard]] bool still() const {
    return scenes_.still() && stages_->still() && cameras_.size() < 2;
  }

  [[nodiscard]] frames::FrameGeometry geometry() const {
    return {rig_.panel.width_px, rig_.panel.height_px, frames::PixelFormat::Rgb8};
  }

  [[nodiscard]] OutputRequest output_request(const std::string& target) const {
    return {.target = target,
            .range = range_,
            .geometry = geometry(),
            .rig = loaded_.identity,
            .rate = rate_,
            .ring_timeout_seconds = flags_.ring_timeout,
            .rig_toml = optics::rig_to_toml(rig_),
            .made_from = made_from(flags_.scene, flags_.camera),
            .resume = flags_.resume,
            .overwrite = flags_.overwrite};
  }

  static render::RenderOptions options_of(const RenderFlags& flags) {
    render::RenderOptions options = flags.options;
    options.keep_missing = !flags.missing.empty();
    options.copy_unchanged = true;
    return options;
  }

  void render_frame(uint64_t number, frames::WovenFrame& frame) {
    prepare_scene(number);
    method_->set_frame(number);
    totals_.add(method_->render(*scene_, stage_, frame));
  }

  /// Renders and delivers a frame; returns false if interrupted. Frames on which it depends are
  /// rendered again even if an earlier run has written them, so that the result does not depend on
  /// where that run stopped.
  bool render_and_deliver(uint64_t number, frames::WovenFrame& frame) {
    const uint64_t first = std::max(method_->first_needed(number), range_.begin);
    for (uint64_t earlier = first; earlier < number; ++earlier) {
      if (interrupted()) return false;
      render_frame(earlier, frame);
      --totals_.rendered;
      ++totals_.again;
    }
    render_frame(number, frame);
    if (output_->deliver(number, frame.view()) == Delivery::Interrupted) return false;
    return !missing_ ||
           missing_->deliver(number, method_->missing_subpixels()->view()) == Delivery::Done;
  }

  /// Commits the scene; one that never changes is committed only once.
  void prepare_scene(uint64_t number) {
    if (scene_ && still()) return;
    const render::SceneDescription description = scene_of(scenes_, cameras_, number);
    stage_ = stages_->at(description, range_.part_before(number));
    scene_.reset();
    scene_ = std::make_unique<render::Scene>(description, stage_, flags_.staging.surroundings,
                                             flags_.options.threads);
  }

  [[nodiscard]] std::string note() const {
    const double frames = static_cast<double>(totals_.rendered + totals_.again);
    return totals_.rendered == 0 ? std::string()
                                 : fmt::format("{:.2f} s/frame", totals_.rays.seconds / frames);
  }

  void report() const {
    if (flags_.json) print_json(result_json(flags_, rig_, stages_->reference(), totals_));
    if (totals_.rays.invalid_rays > 0)
      say("{} rays were not finite and are black\n", totals_.rays.invalid_rays);
    report_reuse();
  }

  void report_reuse() const {
    const render::RenderStatistics& s = totals_.rays;
    if (s.projected_subpixels + s.interpolated_subpixels == 0) return;
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
    say("subpixels: {:.1f} % shaded individually; of {} sampled and traced, {} were off by more "
        "than {:g} code values; in no frame more than {:.2g} % of all (99 % confidence)\n",
        shaded_percent, s.audited_subpixels, s.audited_beyond, flags_.options.tolerated_error,
        100.0 * s.beyond_bound);
    if (s.retraced_subpixels > 0)
      say("{} subpixels in regions with too many errors were traced again\n", s.retraced_subpixels);
  }

  const RenderFlags& flags_;
  FrameRange range_;
  frames::Rate rate_;
  optics::TrimmedRig loaded_;
  const optics::Rig& rig_ = loaded_.rig;
  optics::OpticalModel model_;
  std::unique_ptr<render::Method> method_;
  SceneSequence scenes_;
  std::vector<render::Camera> cameras_;
  std::optional<StageSequence> stages_;
  std::unique_ptr<FrameOutput> output_;
  std::unique_ptr<FrameOutput> missing_;  ///< null unless requested
  render::Stage stage_;
  std::unique_ptr<render::Scene> scene_;
  RunTotals totals_;
};

}  // namespace

Run declare_render(CLI::App& app) {
  auto flags = std::make_shared<RenderFlags>();
  app.add_option("SCENE", flags->scene,
                 "scene file, numbered files ('demo-%02d.nff'), or builtin:NAME[:SIZE]")
      ->required();
  app.add_option("--rig", flags->rig, "rig file of the panel")->required();
  app.add_option("--method", flags->method,
                 "full, lens-view, interpolate, temporal, hybrid or adaptive")
      ->capture_default_str();
  CLI::Option* const error =
      app.add_option("--error", flags->options.tolerated_error,
                     "error that method adaptive may make, in code values; 0 is method full")
          ->capture_default_str();
  app.add_option(
      "--missing", flags->missing,
      "picture file or pattern in which subpixels that reprojection left empty are white");
  app.add_option("--frames", flags->frames, "A:B renders frames A to B - 1, N only frame N")
      ->capture_default_str()
      ->type_name("A:B");
  app.add_option("--fps", flags->fps, "frames per second of the animation")->capture_default_str();
  app.add_option("--camera", flags->camera,
                 "file with one camera per line: from, at, up, field of view");
  app.add_option("--threads", flags->options.threads,
                 "0 means all cores; with a ring, one of four or more is left to the player")
      ->capture_default_str();
  app.add_option("--samples", flags->options.samples, "rays per subpixel, inside its area")
      ->capture_default_str();
  app.add_option("--prefilter", flags->prefilter,
                 "average over the beam of each subpixel: off, depth (outside the sheet's depth of "
                 "field), beam (everywhere) or exhaustive (everywhere, slowly)")
      ->capture_default_str();
  CLI::Option* const prefilter_samples =
      app.add_option("--prefilter-samples", flags->options.prefilter_samples,
                     "largest number of rays per averaged subpixel")
          ->capture_default_str();
  app.add_option("--max-depth", flags->options.max_depth,
                 "largest number of reflections and refractions")
      ->capture_default_str();
  app.add_option("-o,--output", flags->output,
                 "picture file, pattern ('out/%05d.png'), FILE.lts or ring:SOCKET")
      ->required();
  CLI::Option* const resume =
      app.add_flag("--resume", flags->resume, "skip frames that exist already");
  app.add_flag("--overwrite", flags->overwrite, kOverwriteHelp)->excludes(resume);
  app.add_option("--ring-timeout", flags->ring_timeout,
                 "seconds to wait for a player, including one that restarts")
      ->capture_default_str();
  app.add_flag("--json", flags->json, "print what was done as JSON");
  declare_stage_flags(app, flags->staging);
  declare_surroundings_flags(app, flags->staging);
  declare_soft_light_flags(app, flags->options.soft);
  return [flags, error, prefilter_samples]() -> ExitCode {
    complete(*flags);
    refuse_idle_flags(*flags, error->count() > 0, prefilter_samples->count() > 0);
    flags->options.threads = threads_of(*flags);
    return RenderRun(*flags).run();
  };
}

}  // namespace lenticule::player
