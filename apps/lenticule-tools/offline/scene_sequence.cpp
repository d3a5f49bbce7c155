// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/scene_sequence.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "apps/lenticule-tools/offline/built_in_scene.h"
#include "base/error.h"
#include "base/numbers.h"

namespace lenticule::tools {
namespace {

constexpr std::string_view kBuiltIn = "builtin:";

}  // namespace

SceneSequence::SceneSequence(const std::string& scene, frames::Rate rate,
                             const render::LoadOptions& options)
    : rate_(rate), load_options_(options) {
  if (scene.starts_with(kBuiltIn)) {
    const std::string rest = scene.substr(kBuiltIn.size());
    const size_t colon = rest.find(':');
    built_in_ = &scenes::find_scene(rest.substr(0, colon));
    if (colon != std::string::npos) {
      const auto size = number_from<uint64_t>(std::string_view(rest).substr(colon + 1));
      if (!size || *size > static_cast<uint64_t>(built_in_->largest_size))
        throw Error(ErrorKind::Usage,
                    fmt::format("{}: not a size from 1 to {}", scene, built_in_->largest_size));
      size_ = static_cast<int>(*size);
    }
    still_ = built_in_->frames == 1;
  } else if (frames::FilePattern::looks_like_pattern(scene)) {
    pattern_.emplace(scene);
    (void)pattern_->existing_or_throw();
  } else {
    file_ = render::load_scene(scene, load_options_);
    still_ = !(file_->duration_seconds > 0.0);
  }
}

void SceneSequence::require(const player::FrameRange& range) const {
  if (!pattern_) return;
  const std::vector<uint64_t> numbers = pattern_->existing();
  for (uint64_t frame = range.begin; frame < range.end; ++frame)
    if (!std::binary_search(numbers.begin(), numbers.end(), frame))
      throw Error(
          ErrorKind::Input, fmt::format("{}: no such file", pattern_->path(frame).string()),
          fmt::format("the files there are numbered {} ... {}", numbers.front(), numbers.back()));
}

uint64_t SceneSequence::reference_frame() const {
  return pattern_ ? pattern_->existing().front() : 0;
}

render::SceneDescription SceneSequence::at(uint64_t frame) const {
  if (built_in_) return built_in(frame);
  if (pattern_)
    return render::at_time(render::load_scene(pattern_->path(frame), load_options_), 0.0);
  const double seconds = static_cast<double>(frame) / rate_.hertz();
  return render::at_time(*file_, still_ ? 0.0 : seconds);
}

render::SceneDescription SceneSequence::built_in(uint64_t frame) const {
  const auto period = static_cast<uint64_t>(std::max(1, built_in_->frames));
  const int in_period = static_cast<int>(frame % period);
  return describe_built_in(*built_in_, size_, in_period);
}

StageSequence::StageSequence(const render::SceneDescription& reference,
                             const render::Canvas& canvas, const render::StageOptions& options,
                             double turned_by_degrees)
    : canvas_(canvas), turned_by_degrees_(turned_by_degrees), options_(options) {
  if (!still()) options_.fit_every_turn = true;
  reference_ = render::make_stage(reference, canvas_, options_);
  options_.depth_scale = reference_.depth_scale;
  ground_ = render::ground_under(render::scene_bounds(reference));
}

render::Stage StageSequence::at(const render::SceneDescription& scene, double progress) const {
  render::StageOptions options = options_;
  options.turn_degrees += turned_by_degrees_ * progress;
  const bool has_camera = render::placing_camera(scene, options) != nullptr;
  if (!has_camera && !still()) {
    options.centre = reference_.world_from_panel.origin;
    options.mm_per_unit = reference_.mm_per_unit;
  }
  render::Stage stage =
      has_camera || !still() ? render::make_stage(scene, canvas_, options) : reference_;
  // Objects that leave the reference frame's bounds must not be clipped if there is no camera.
  if (!has_camera) stage.near_mm = std::numeric_limits<double>::infinity();
  stage.ground = ground_;
  return stage;
}

}  // namespace lenticule::tools
