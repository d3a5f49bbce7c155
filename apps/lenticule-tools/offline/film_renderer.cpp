// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/film_renderer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/print.h"
#include "optics/rig_file.h"
#include "player/sources/source_spec.h"
#include "render/loaders/animation.h"

namespace lenticule::tools {
namespace {

/// Part of the frame period to use; the rest is for frames that take longer than others.
constexpr double kUsed = 0.95;
/// Largest deviation from that time, as log2 of the ratio, at which the error stays: 5 %.
constexpr double kEnough = 0.07;
constexpr double kLeastPower = 0.25;
constexpr double kFirstPower = 1.0;
constexpr double kMostPower = 2.5;
constexpr double kGrowth = 1.3;
/// Largest correction at a time: one scene cut must not move the error from end to end.
constexpr double kMostOctaves = 1.5;

}  // namespace

ErrorController::ErrorController(double frames_per_s)
    : target_s_(kUsed / frames_per_s), log2_error_(std::log2(kFirstError)), power_(kFirstPower) {
  if (!(frames_per_s >= 0.01 && frames_per_s <= 1000.0))
    throw Error(
        ErrorKind::Usage,
        fmt::format("--adapt-error {}: not in 0.01 ... 1000 frames per second", frames_per_s));
}

double ErrorController::error() const noexcept {
  return std::exp2(log2_error_);
}

void ErrorController::add_frame(double seconds) noexcept {
  times_[count_++] = std::max(seconds, 1e-6);
  if (count_ < kFrames) return;
  count_ = 0;
  std::ranges::sort(times_);
  const double ratio = std::log2(times_[kFrames / 2] / target_s_);
  if (std::abs(ratio) <= kEnough) return;
  if (last_step_ * ratio < 0.0) power_ = std::max(kLeastPower, power_ / 2.0);
  const double before = log2_error_;
  const double step = std::clamp(power_ * ratio, -kMostOctaves, kMostOctaves);
  log2_error_ = std::clamp(before + step, std::log2(kLeastError), std::log2(kMostError));
  if (last_step_ * ratio > 0.0) power_ = std::min(kMostPower, power_ * kGrowth);
  // A step that the limits swallow says nothing about the next one.
  last_step_ = log2_error_ - before;
}

namespace {

render::Canvas canvas_of_wall(const optics::PlacedWall& wall, Interval x_mm, Interval y_mm) {
  render::Canvas canvas{.width_mm = x_mm.width(),
                        .height_mm = y_mm.width(),
                        .depth_of_field_mm = std::numeric_limits<double>::infinity(),
                        .viewing_distance_mm = wall.viewer_mm.z};
  for (const optics::PlacedPanel& panel : wall.panels)
    canvas.depth_of_field_mm = std::min(
        canvas.depth_of_field_mm, optics::OpticalModel(panel.trimmed.rig).depth_of_field_mm());
  return canvas;
}

}  // namespace

FilmPanel panel_of_rig(const std::string& rig_file) {
  optics::TrimmedRig trimmed = optics::load_rig_and_identity(rig_file);
  const render::Canvas canvas = render::canvas_of(optics::OpticalModel(trimmed.rig));
  return {.trimmed = std::move(trimmed), .canvas = canvas};
}

FilmPanel panel_of_wall(const optics::PlacedWall& wall, const optics::PlacedPanel& panel) {
  Interval x_mm, y_mm;
  for (const optics::PlacedPanel& each : wall.panels) {
    x_mm.extend(each.x_mm);
    y_mm.extend(each.y_mm);
  }
  FilmPanel out{.trimmed = panel.trimmed,
                .canvas = canvas_of_wall(wall, x_mm, y_mm),
                .name = panel.name,
                .canvas_from_panel = panel.wall_from_panel};
  const Vec3 middle{(x_mm.low + x_mm.high) / 2.0, (y_mm.low + y_mm.high) / 2.0, 0.0};
  out.canvas_from_panel.origin = panel.wall_from_panel.origin - middle;
  return out;
}

FilmPanel panel_of_rig_or_wall(const std::string& rig_file, const std::string& wall_file,
                               const std::string& panel) {
  if (wall_file.empty()) return panel_of_rig(rig_file);
  if (panel.empty())
    throw Error(ErrorKind::Usage, fmt::format("--wall {}: a film is for one panel", wall_file),
                "choose one with --panel NAME; each panel has a film of its own");
  const optics::PlacedWall wall = optics::load_wall(wall_file);
  return panel_of_wall(wall, wall.panel(panel));
}

std::string target_of_panel(const std::string& target, const std::string& panel) {
  if (player::parse_source(target).kind == player::SourceKind::Ring)
    throw Error(ErrorKind::Usage, fmt::format("-o {}: a wall has a frame per panel", target),
                "choose one with --panel NAME");
  return optics::file_of_panel(target, panel);
}

namespace {

void print_stage(const render::Stage& stage) {
  say("stage: {:.4g} mm per unit, depth {:.3g} times; ", stage.mm_per_unit, stage.depth_scale);
  say("from {:.1f} mm in front of the panel to {:.1f} mm behind it; ", stage.near_mm,
      -stage.far_mm);
  say("sharp within {:.1f} mm\n", stage.depth_of_field_mm);
}

void print_notes(const render::SceneDescription& scene) {
  for (const std::string& note : scene.notes) say("{}: {}\n", scene.source, note);
}

render::RenderOptions options_of(const RenderFlags& flags, bool keep_missing) {
  render::RenderOptions options = flags.options;
  options.keep_missing = keep_missing;
  options.copy_unchanged = true;
  return options;
}

}  // namespace

FilmRenderer::FilmRenderer(const RenderFlags& flags, FilmPanel panel, player::FrameRange film,
                           bool keep_missing)
    : flags_(flags),
      film_(film),
      rate_(frames::parse_rate(flags.fps)),
      panel_(std::move(panel)),
      model_(panel_.trimmed.rig),
      method_(render::make_method(flags.method, model_, options_of(flags, keep_missing))),
      scenes_(flags.scene, rate_, flags.staging.load) {
  if (!flags.camera.empty()) cameras_ = render::load_camera_path(flags.camera);
  scenes_.require(film_);
  const render::SceneDescription reference = scene_of(scenes_.reference_frame());
  print_notes(reference);
  stages_.emplace(reference, panel_.canvas, flags.staging.stage, flags.staging.turned_by_degrees);
  print_stage(stages_->reference());
  require_content_in_view(still() ? reference : scene_of(film_.begin));
}

/// Returns the scene of one frame, with the camera path's camera if there is one.
render::SceneDescription FilmRenderer::scene_of(uint64_t frame) const {
  render::SceneDescription scene = scenes_.at(frame);
  // The camera stays at the last line of the path.
  if (!cameras_.empty()) scene.cameras = {cameras_[std::min<uint64_t>(frame, cameras_.size() - 1)]};
  return scene;
}

/// Returns the placement of a scene at the film's panel.
render::Stage FilmRenderer::stage_at(const render::SceneDescription& scene, double progress) const {
  render::Stage stage = stages_->at(scene, progress);
  if (!panel_.in_wall()) return stage;
  return render::stage_of_panel(stage, panel_.canvas_from_panel, panel_.name);
}

/// Refuses a scene of which the first frame shows nothing. If later frames or other panels may show
/// it, or if there are surroundings to see, this is only noted.
void FilmRenderer::require_content_in_view(const render::SceneDescription& first) const {
  const render::Stage stage = stage_at(first, 0.0);
  if (render::content_meets_rays(first, stage, model_)) return;
  const bool camera = render::placing_camera(first, flags_.staging.stage) != nullptr;
  const std::string what =
      fmt::format("nothing to see in this scene: all of it lies outside the {}",
                  camera ? "camera's view" : "panel");
  const render::Surroundings& around = flags_.staging.surroundings;
  const bool empty = still() && !panel_.in_wall() && !around.sky && !around.ground &&
                     around.environment_file.empty();
  if (empty)
    throw Error(ErrorKind::Input, fmt::format("{}: {}", first.source, what),
                camera ? "--fit ignores the camera and fits the whole scene into the panel"
                       : "render without --centre and --mm-per-unit, which fits it");
  say("{}: frame {}: {}\n", first.source, film_.begin, what);
}

/// Returns true if all frames are equal.
bool FilmRenderer::still() const {
  return scenes_.still() && stages_->still() && cameras_.size() < 2;
}

frames::FrameGeometry FilmRenderer::geometry() const {
  return {rig().panel.width_px, rig().panel.height_px, frames::PixelFormat::Rgb8};
}

OutputRequest FilmRenderer::output_request(const std::string& target,
                                           const player::FrameRange& range) const {
  return {.target = target,
          .range = range,
          .geometry = geometry(),
          .rig = panel_.trimmed.identity,
          .rate = rate_,
          .rig_toml = optics::rig_to_toml(rig()),
          .made_from = made_from(flags_.scene, flags_.camera)};
}

/// Renders the needed frames even if an earlier run has written them, so that the result does not
/// depend on where that run stopped.
bool FilmRenderer::render(uint64_t number, frames::WovenFrame& frame,
                          const std::function<bool()>& stops, const Count& count) {
  const uint64_t first = std::max(method_->first_needed(number), film_.begin);
  for (uint64_t earlier = first; earlier <= number; ++earlier) {
    if (stops()) return false;
    const render::RenderStatistics statistics = render_frame(earlier, frame);
    if (count) count(statistics, earlier < number);
  }
  return true;
}

render::RenderStatistics FilmRenderer::render_frame(uint64_t number, frames::WovenFrame& frame) {
  prepare_scene(number);
  method_->set_frame(number);
  return method_->render(*scene_, stage_, frame);
}

/// Commits the scene; one that never changes is committed only once.
void FilmRenderer::prepare_scene(uint64_t number) {
  if (scene_ && still()) return;
  const render::SceneDescription description = scene_of(number);
  stage_ = stage_at(description, film_.part_before(number));
  scene_.reset();
  scene_ = std::make_unique<render::Scene>(description, stage_, flags_.staging.surroundings,
                                           flags_.options.threads);
}

}  // namespace lenticule::tools
