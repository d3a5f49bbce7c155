// SPDX-License-Identifier: Apache-2.0
// describe_built_in makes a render::SceneDescription from a built-in scene.
#pragma once

#include <optional>
#include <string>

#include "frames/image_io.h"
#include "frames/rational.h"
#include "player/sources/source_spec.h"
#include "render/loaders/load_scene.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"
#include "scenes/scene_list.h"

namespace lenticule::tools {

/// Describes the scene's elements as the reader of NFF would, and adds the textured surfaces. The
/// source of the result is "builtin:NAME". Throws as scenes::build_scene does.
[[nodiscard]] render::SceneDescription describe_built_in(const scenes::BuiltInScene& scene,
                                                         std::optional<int> size = {},
                                                         int frame = 0);

// SceneSequence provides the scene of every frame: from one file (with or without animation),
// numbered files, or a built-in sequence.

class SceneSequence {
 public:
  /// `scene` is a file, a pattern with %d or %0Nd, or builtin:NAME[:SIZE]. Throws Error(Input) for
  /// files that cannot be read and for a pattern without any file, Error(Usage) for unknown names.
  SceneSequence(const std::string& scene, frames::Rate rate,
                const render::LoadOptions& options = {});

  /// Checks, before rendering, that all files of the range exist. Throws Error(Input) if one is
  /// missing.
  void require(const player::FrameRange& range) const;

  /// Returns the scene of a frame, without nodes.
  [[nodiscard]] render::SceneDescription at(uint64_t frame) const;
  /// Returns true if every frame has the same scene.
  [[nodiscard]] bool still() const { return still_; }
  /// Returns the frame that determines size and depth, independent of the range to render.
  [[nodiscard]] uint64_t reference_frame() const;

 private:
  [[nodiscard]] render::SceneDescription built_in(uint64_t frame) const;

  frames::Rate rate_;
  render::LoadOptions load_options_;
  bool still_ = false;
  std::optional<frames::FilePattern> pattern_;
  const scenes::BuiltInScene* built_in_ = nullptr;
  std::optional<int> size_;
  std::optional<render::SceneDescription> file_;
};

/// StageSequence places the scenes of an animation: the depth scale, and without a camera the
/// position and the size, stay constant from frame to frame, and so does the ground.
class StageSequence {
 public:
  /// `reference` is the scene of SceneSequence::reference_frame(). Over the sequence the scene
  /// turns by `turned_by_degrees`, beginning with the turn in `options`. If `same_content`, all
  /// scenes are `reference`, apart from the camera, and at() does not look at their content.
  StageSequence(const render::SceneDescription& reference, const render::Canvas& canvas,
                const render::StageOptions& options, double turned_by_degrees = 0.0,
                bool same_content = false);

  /// Returns the placement of the reference frame, to report to the user.
  [[nodiscard]] const render::Stage& reference() const { return reference_; }
  /// Returns the placement after the part `progress` of the sequence, 0 at its first frame.
  [[nodiscard]] render::Stage at(const render::SceneDescription& scene,
                                 double progress = 0.0) const;
  /// Returns true if the same scene has the same placement in all frames.
  [[nodiscard]] bool still() const { return turned_by_degrees_ == 0.0; }

 private:
  render::Canvas canvas_;
  double turned_by_degrees_;
  render::StageOptions options_;
  render::Stage reference_;
  render::Ground ground_;      ///< ground in the reference frame, used by all frames
  std::optional<Box> bounds_;  ///< content's bounds, if the same in all frames
};
}  // namespace lenticule::tools
