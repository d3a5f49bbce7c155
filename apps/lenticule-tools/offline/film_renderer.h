// SPDX-License-Identifier: Apache-2.0
// FilmRenderer renders the frames of a film for a FilmPanel: one alone, or one of a wall.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule-tools/cli/render_flags.h"
#include "apps/lenticule-tools/offline/frame_output.h"
#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "base/error_kinds.h"
#include "base/print.h"
#include "optics/rig_file.h"
#include "optics/wall/wall.h"
#include "player/sources/source_spec.h"
#include "render/loaders/animation.h"
#include "render/methods/method.h"
#include "render/scene/scene.h"
#include "render/scene/stage.h"

namespace lenticule::tools {

// ErrorController chooses the tolerated error of method adaptive, frame by frame, so that a live
// renderer holds a rate.

/// It compares the median time of three frames with the time that the rate allows, and multiplies
/// the error by a power of that ratio. The power is halved when the correction changes direction,
/// and grows while it does not, so that the error converges without swinging, no matter how much
/// time a larger error saves. Within a few percent of the rate the error stays as it is.
///
/// Thread safety: one thread.
class ErrorController {
 public:
  static constexpr double kLeastError = 0.5;  ///< code values
  static constexpr double kMostError = 16.0;
  static constexpr double kFirstError = 2.0;

  /// Throws Error(Usage) unless the rate is between 0.01 and 1000 frames per second.
  explicit ErrorController(double frames_per_s)
      : target_s_(kUsed / frames_per_s), log2_error_(std::log2(kFirstError)), power_(kFirstPower) {
    if (!(frames_per_s >= 0.01 && frames_per_s <= 1000.0))
      throw usage_error("--adapt-error {}: not in 0.01 ... 1000 frames per second", frames_per_s);
  }

  /// Returns the error to tolerate in the next frame, in code values.
  [[nodiscard]] double error() const noexcept { return std::exp2(log2_error_); }
  /// Reports the time that the frame with error() took, without waits for the player.
  void add_frame(double seconds) noexcept {
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

 private:
  /// Part of the frame period to use; the rest is for frames that take longer than others.
  static constexpr double kUsed = 0.95;
  /// Largest deviation from that time, as log2 of the ratio, at which the error stays: 5 %.
  static constexpr double kEnough = 0.07;
  static constexpr double kLeastPower = 0.25;
  static constexpr double kFirstPower = 1.0;
  static constexpr double kMostPower = 2.5;
  static constexpr double kGrowth = 1.3;
  /// Largest correction at a time: one scene cut must not move the error from end to end.
  static constexpr double kMostOctaves = 1.5;
  static constexpr size_t kFrames = 3;

  double target_s_;
  double log2_error_;
  double power_;
  double last_step_ = 0.0;
  std::array<double, kFrames> times_{};
  size_t count_ = 0;
};

struct FilmPanel {
  optics::TrimmedRig trimmed;
  render::Canvas canvas;  ///< the panel, or the rectangle around all panels of the wall
  std::string name{};     ///< the panel's name in its wall; empty for a panel alone
  Affine canvas_from_panel{};

  [[nodiscard]] bool in_wall() const { return !name.empty(); }
};

/// Loads the rig of a panel alone. Throws Error(Input).
[[nodiscard]] inline FilmPanel panel_of_rig(const std::string& rig_file) {
  optics::TrimmedRig trimmed = optics::load_rig_and_identity(rig_file);
  const render::Canvas canvas = render::canvas_of(optics::OpticalModel(trimmed.rig));
  return {.trimmed = std::move(trimmed), .canvas = canvas};
}

inline render::Canvas canvas_of_wall(const optics::PlacedWall& wall, Interval x_mm, Interval y_mm) {
  render::Canvas canvas{.width_mm = x_mm.width(),
                        .height_mm = y_mm.width(),
                        .depth_of_field_mm = std::numeric_limits<double>::infinity(),
                        .viewing_distance_mm = wall.viewer_mm.z};
  for (const optics::PlacedPanel& panel : wall.panels)
    canvas.depth_of_field_mm = std::min(
        canvas.depth_of_field_mm, optics::OpticalModel(panel.trimmed.rig).depth_of_field_mm());
  return canvas;
}

/// Returns a panel of a wall. The scene's centre lies in the middle of the rectangle around all
/// panels, in the wall's plane z = 0.
[[nodiscard]] inline FilmPanel panel_of_wall(const optics::PlacedWall& wall,
                                             const optics::PlacedPanel& panel) {
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

/// Returns the panel of a rig, or the named panel of a wall if there is a wall. Throws Error(Usage)
/// for a wall without the name of a panel, and Error(Input).
[[nodiscard]] inline FilmPanel panel_of_rig_or_wall(const std::string& rig_file,
                                                    const std::string& wall_file,
                                                    const std::string& panel) {
  if (wall_file.empty()) return panel_of_rig(rig_file);
  if (panel.empty())
    throw usage_error("--wall {}: a film is for one panel", wall_file)
        .remedy("choose one with --panel NAME; each panel has a film of its own");
  const optics::PlacedWall wall = optics::load_wall(wall_file);
  return panel_of_wall(wall, wall.panel(panel));
}

/// Returns optics::file_of_panel(). Throws Error(Usage) for a target that is no file.
[[nodiscard]] inline std::string target_of_panel(const std::string& target,
                                                 const std::string& panel) {
  if (player::parse_source(target).kind == player::SourceKind::Ring)
    throw usage_error("-o {}: a wall has a frame per panel", target)
        .remedy("choose one with --panel NAME");
  return optics::file_of_panel(target, panel);
}

// FilmRenderer renders frames of a film in any order. A frame's bytes depend on the film and the
// number alone, not on which frames were rendered before.

class FilmRenderer {
 public:
  /// Loads the scene; `film` are all frames of the film. Reports the placement and repairs of the
  /// scene with say(). Throws Error(Usage) and Error(Input), also if the first frame of a still
  /// scene shows nothing on a panel that is not part of a wall.
  ///
  /// Lifetime: must not outlive `flags`.
  FilmRenderer(const RenderFlags& flags, FilmPanel panel, player::FrameRange film,
               bool keep_missing = false)
      : flags_(flags),
        film_(film),
        rate_(frames::parse_rate(flags.fps)),
        panel_(std::move(panel)),
        model_(panel_.trimmed.rig),
        method_(render::make_method(flags.method, model_, options_of(flags, keep_missing))),
        scenes_(flags.scene, rate_, flags.staging.load),
        surroundings_(flags.staging.surroundings) {
    if (!flags.camera.empty()) cameras_ = render::load_camera_path(flags.camera);
    scenes_.require(film_);
    const render::SceneDescription reference = scene_of(scenes_.reference_frame());
    for (const std::string& note : reference.notes) say("{}: {}\n", reference.source, note);
    stages_.emplace(reference, panel_.canvas, flags.staging.stage, flags.staging.turned_by_degrees,
                    scenes_.still());
    print_stage(stages_->reference());
    // Chosen once, so that it is the same in all frames.
    const auto background = render::studio_background(reference);
    if (!surroundings_.background && background == render::kDarkStudioBackground)
      say("{}: the background is dark grey, since the model is bright (--background)\n",
          reference.source);
    if (!surroundings_.background) surroundings_.background = background;
    require_content_in_view(still() ? reference : scene_of(film_.begin));
    keeper_.emplace(surroundings_, flags.options.threads);
  }
  /// Loads the rig of the flags, too, or that of a panel of their wall.
  FilmRenderer(const RenderFlags& flags, player::FrameRange film, bool keep_missing = false)
      : FilmRenderer(flags, panel_of_rig_or_wall(flags.rig, flags.wall, flags.panel), film,
                     keep_missing) {}
  FilmRenderer(const FilmRenderer&) = delete;
  FilmRenderer& operator=(const FilmRenderer&) = delete;

  [[nodiscard]] const player::FrameRange& film() const { return film_; }
  [[nodiscard]] const optics::Rig& rig() const { return panel_.trimmed.rig; }
  [[nodiscard]] frames::FrameGeometry geometry() const {
    return {rig().panel.width_px, rig().panel.height_px, frames::PixelFormat::Rgb8};
  }
  [[nodiscard]] const render::Method& method() const { return *method_; }
  /// Changes the tolerated error of the next frames, whose bytes depend on it then. Returns false
  /// if the method tolerates no error, on this rig.
  [[nodiscard]] bool set_tolerated_error(double error) {
    return method_->set_tolerated_error(error);
  }
  [[nodiscard]] const render::Stage& reference_stage() const { return stages_->reference(); }
  [[nodiscard]] const SceneSequence& scenes() const { return scenes_; }

  [[nodiscard]] const FilmPanel& panel() const { return panel_; }

  /// Returns the request of an output of the frames `range`.
  [[nodiscard]] OutputRequest output_request(const std::string& target,
                                             const player::FrameRange& range) const {
    frames::SequenceInfo film;
    film.geometry = geometry();
    film.rate = rate_;
    film.first_frame = range.begin;
    frames::state_rig(film, panel_.trimmed.identity);
    film.rig_toml = optics::rig_to_toml(rig());
    film.made_from = made_from(flags_.scene, flags_.camera);
    film.software = program_version();
    return {.target = target, .range = range, .film = std::move(film)};
  }

  /// Counts a rendered frame; `again`: it is rendered only because the next one depends on it.
  using Count = std::function<void(const render::RenderStatistics&, bool again)>;

  /// Renders a frame, and before it the frames on which it depends, unless they were rendered last.
  /// Returns false if `stops` returned true before a frame.
  /// Renders the needed frames even if an earlier run has written them, so that the result does not
  /// depend on where that run stopped.
  [[nodiscard]] bool render(uint64_t number, frames::WovenFrame& frame,
                            const std::function<bool()>& stops, const Count& count = {}) {
    const uint64_t first = std::max(method_->first_needed(number), film_.begin);
    for (uint64_t earlier = first; earlier <= number; ++earlier) {
      if (stops()) return false;
      const render::RenderStatistics statistics = render_frame(earlier, frame);
      if (count) count(statistics, earlier < number);
    }
    return true;
  }

 private:
  static void print_stage(const render::Stage& stage) {
    const Vec3 centre = stage.world_from_panel.origin;
    const auto reach = [](double near_mm, double far_mm) {
      return fmt::format("from {:.1f} mm in front of the panel to {:.1f} mm behind it", near_mm,
                         -far_mm);
    };
    say("stage: {:.4g} mm per unit, depth {:.3g} times; ({:.4g}, {:.4g}, {:.4g}) lies in the "
        "panel; ",
        stage.mm_per_unit, stage.depth_scale, centre.x, centre.y, centre.z);
    say("{}; sharp within {:.1f} mm\n", reach(stage.near_mm, stage.far_mm),
        stage.depth_of_field_mm);
    if (!stage.subject_mm.empty())
      say("stage: the depth is fitted to what reaches {}, not to the floor or backdrop around it\n",
          reach(stage.subject_mm.high, stage.subject_mm.low));
    else if (stage.depth_scale < 0.25)
      say("stage: the scene is flattened; --depth-budget N makes it N times as deep, and less "
          "sharp\n");
  }

  static render::RenderOptions options_of(const RenderFlags& flags, bool keep_missing) {
    render::RenderOptions options = flags.options;
    options.keep_missing = keep_missing;
    options.copy_unchanged = true;
    return options;
  }
  /// Refuses a scene of which the first frame shows nothing. If later frames or other panels may
  /// show it, or if there are surroundings to see, this is only noted. Shows both sides of surfaces
  /// if nothing else would be seen.
  void require_content_in_view(const render::SceneDescription& first) {
    const render::Stage stage = stage_at(first, 0.0);
    const render::InView in_view = render::content_in_view(first, stage, model_);
    both_sides_ = in_view == render::InView::BackFaces && !panel_.in_wall();
    if (both_sides_) say("{}: {}\n", first.source, render::kBothSides);
    if (in_view != render::InView::Nothing) return;
    const bool camera = render::placing_camera(first, flags_.staging.stage) != nullptr;
    const std::string what =
        fmt::format("nothing to see in this scene: all of it lies outside the {}",
                    camera ? "camera's view" : "panel");
    const render::Surroundings& around = surroundings_;
    const bool empty = still() && !panel_.in_wall() && !around.sky && !around.ground &&
                       around.environment_file.empty();
    if (empty)
      throw input_error("{}: {}", first.source, what)
          .remedy(camera ? "--fit ignores the camera and fits the whole scene into the panel"
                         : "render without --centre and --mm-per-unit, which fits it");
    say("{}: frame {}: {}\n", first.source, film_.begin, what);
  }
  /// Returns true if all frames are equal.
  [[nodiscard]] bool still() const {
    return scenes_.still() && stages_->still() && cameras_.size() < 2;
  }
  /// Returns the placement of a scene at the film's panel.
  [[nodiscard]] render::Stage stage_at(const render::SceneDescription& scene,
                                       double progress) const {
    render::Stage stage = stages_->at(scene, progress);
    if (!panel_.in_wall()) return stage;
    return render::stage_of_panel(stage, panel_.canvas_from_panel, panel_.name);
  }
  /// Returns the scene of one frame, with the camera path's camera if there is one.
  [[nodiscard]] render::SceneDescription scene_of(uint64_t frame) const {
    render::SceneDescription scene = scenes_.at(frame);
    set_camera(frame, scene);
    if (both_sides_) render::show_both_sides(scene);
    return scene;
  }
  /// The camera stays at the last line of the path.
  void set_camera(uint64_t frame, render::SceneDescription& scene) const {
    if (!cameras_.empty())
      scene.cameras = {cameras_[std::min<uint64_t>(frame, cameras_.size() - 1)]};
  }
  render::RenderStatistics render_frame(uint64_t number, frames::WovenFrame& frame) {
    prepare_scene(number);
    method_->set_frame(number);
    return method_->render(*scene_, stage_, frame);
  }
  /// Commits the scene; one that never changes is committed only once.
  void prepare_scene(uint64_t number) {
    if (scene_ && still()) return;
    if (!description_) description_ = std::make_shared<render::SceneDescription>(scene_of(number));
    set_camera(number, *description_);
    stage_ = stage_at(*description_, film_.part_before(number));
    scene_ = nullptr;  // commit() may throw, and keeps no scene then
    scene_ = &keeper_->commit(description_, stage_);
    if (!scenes_.still() || still()) description_.reset();
  }

  const RenderFlags& flags_;
  player::FrameRange film_;
  frames::Rate rate_;
  FilmPanel panel_;
  optics::OpticalModel model_;
  std::unique_ptr<render::Method> method_;
  SceneSequence scenes_;
  std::vector<render::Camera> cameras_;
  std::optional<StageSequence> stages_;
  render::Surroundings surroundings_;
  bool both_sides_ = false;  ///< single-sided surfaces are shown from behind, too
  render::Stage stage_;
  std::shared_ptr<render::SceneDescription> description_;  ///< null if it changes or is not needed
  std::optional<render::SceneKeeper> keeper_;
  const render::Scene* scene_ = nullptr;
};

}  // namespace lenticule::tools
