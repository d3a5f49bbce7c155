// SPDX-License-Identifier: Apache-2.0
// FilmRenderer renders the frames of a film for a FilmPanel: one alone, or one of a wall.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule-tools/cli/render_flags.h"
#include "apps/lenticule-tools/offline/frame_output.h"
#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "optics/wall/wall.h"
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
  explicit ErrorController(double frames_per_s);

  /// Returns the error to tolerate in the next frame, in code values.
  [[nodiscard]] double error() const noexcept;
  /// Reports the time that the frame with error() took, without waits for the player.
  void add_frame(double seconds) noexcept;

 private:
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
[[nodiscard]] FilmPanel panel_of_rig(const std::string& rig_file);

/// Returns a panel of a wall. The scene's centre lies in the middle of the rectangle around all
/// panels, in the wall's plane z = 0.
[[nodiscard]] FilmPanel panel_of_wall(const optics::PlacedWall& wall,
                                      const optics::PlacedPanel& panel);

/// Returns the panel of a rig, or the named panel of a wall if there is a wall. Throws Error(Usage)
/// for a wall without the name of a panel, and Error(Input).
[[nodiscard]] FilmPanel panel_of_rig_or_wall(const std::string& rig_file,
                                             const std::string& wall_file,
                                             const std::string& panel);

/// Returns optics::file_of_panel(). Throws Error(Usage) for a target that is no file.
[[nodiscard]] std::string target_of_panel(const std::string& target, const std::string& panel);

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
               bool keep_missing = false);
  /// Loads the rig of the flags, too, or that of a panel of their wall.
  FilmRenderer(const RenderFlags& flags, player::FrameRange film, bool keep_missing = false)
      : FilmRenderer(flags, panel_of_rig_or_wall(flags.rig, flags.wall, flags.panel), film,
                     keep_missing) {}
  FilmRenderer(const FilmRenderer&) = delete;
  FilmRenderer& operator=(const FilmRenderer&) = delete;

  [[nodiscard]] const player::FrameRange& film() const { return film_; }
  [[nodiscard]] const optics::Rig& rig() const { return panel_.trimmed.rig; }
  [[nodiscard]] frames::FrameGeometry geometry() const;
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
                                             const player::FrameRange& range) const;

  /// Counts a rendered frame; `again`: it is rendered only because the next one depends on it.
  using Count = std::function<void(const render::RenderStatistics&, bool again)>;

  /// Renders a frame, and before it the frames on which it depends, unless they were rendered last.
  /// Returns false if `stops` returned true before a frame.
  [[nodiscard]] bool render(uint64_t number, frames::WovenFrame& frame,
                            const std::function<bool()>& stops, const Count& count = {});

 private:
  void require_content_in_view(const render::SceneDescription& first) const;
  [[nodiscard]] bool still() const;
  [[nodiscard]] render::Stage stage_at(const render::SceneDescription& scene,
                                       double progress) const;
  [[nodiscard]] render::SceneDescription scene_of(uint64_t frame) const;
  render::RenderStatistics render_frame(uint64_t number, frames::WovenFrame& frame);
  void prepare_scene(uint64_t number);

  const RenderFlags& flags_;
  player::FrameRange film_;
  frames::Rate rate_;
  FilmPanel panel_;
  optics::OpticalModel model_;
  std::unique_ptr<render::Method> method_;
  SceneSequence scenes_;
  std::vector<render::Camera> cameras_;
  std::optional<StageSequence> stages_;
  render::Stage stage_;
  std::unique_ptr<render::Scene> scene_;
};

}  // namespace lenticule::tools
