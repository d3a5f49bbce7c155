// SPDX-License-Identifier: Apache-2.0
// The scene of every frame: one file (perhaps with an animation), numbered files, or a built-in
// sequence.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "frames/image_io.h"
#include "frames/rational.h"
#include "optics/model.h"
#include "player/sources/frame_range.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"
#include "scenes/scene_list.h"

namespace lenticule::player {

class SceneSequence {
 public:
  /// SCENE is a file, a pattern with %d or %0Nd, or builtin:NAME[:SIZE]. Throws Error(Input) for
  /// files that cannot be read and for a pattern without any file, Error(Usage) for unknown names.
  SceneSequence(const std::string& scene, frames::Rate rate);

  /// Throws Error(Input) if a file of the range is missing, before anything is rendered.
  void require(const FrameRange& range) const;

  /// The scene of a frame, without nodes.
  [[nodiscard]] render::SceneDescription at(uint64_t frame) const;
  /// True if every frame's scene is the same.
  [[nodiscard]] bool still() const { return still_; }
  /// The frame that decides about size and depth, whichever frames are rendered.
  [[nodiscard]] uint64_t reference_frame() const;

 private:
  [[nodiscard]] render::SceneDescription built_in(uint64_t frame) const;

  frames::Rate rate_;
  bool still_ = false;
  std::optional<frames::FilePattern> pattern_;
  const scenes::BuiltInScene* built_in_ = nullptr;
  std::optional<int> size_;
  std::optional<render::SceneDescription> file_;
};

/// Stages that belong together: an animation keeps its depth scale, and without a camera its place,
/// from frame to frame.
class StageSequence {
 public:
  /// `reference` is the scene of SceneSequence::reference_frame(). The model must outlive it.
  StageSequence(const render::SceneDescription& reference, const optics::OpticalModel& model,
                const render::StageOptions& options);

  /// Of the reference frame: for telling the user.
  [[nodiscard]] const render::Stage& reference() const { return reference_; }
  [[nodiscard]] render::Stage at(const render::SceneDescription& scene) const;

 private:
  const optics::OpticalModel& model_;
  render::StageOptions options_;
  render::Stage reference_;
};

}  // namespace lenticule::player
