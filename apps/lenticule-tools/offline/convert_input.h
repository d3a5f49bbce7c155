// SPDX-License-Identifier: Apache-2.0
// ConvertInput is the input of lenticule convert: frames of one size, already woven or made from
// views.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "frames/frame.h"
#include "frames/sequence/sequence_info.h"
#include "frames/views_input/view_input.h"
#include "player/sources/pictures.h"
#include "player/sources/weaving_source.h"

namespace lenticule::tools {

enum class ReadResult { Ok, Damaged, End };

/// Thread safety: one thread.
class ConvertInput {
 public:
  virtual ~ConvertInput() = default;
  /// Returns the number of frames if known.
  [[nodiscard]] virtual std::optional<uint64_t> count() const = 0;
  /// Returns the metadata; the geometry is that of the frames.
  [[nodiscard]] virtual frames::SequenceInfo info() const = 0;
  /// Reads frame `number`, counted from 0; numbers must increase, except that the last one may be
  /// repeated. Throws Error(Input) for input that cannot be read, Error(Failed) if no more frames
  /// arrive.
  [[nodiscard]] virtual ReadResult read(uint64_t number, frames::WovenFrame& frame) = 0;
  /// Returns the damage, so far, that the sources left out or replaced.
  [[nodiscard]] virtual frames::FrameDamage damage() const { return {}; }
};

/// Opens the woven frames of a container, readable in any order.
[[nodiscard]] std::unique_ptr<ConvertInput> open_container_input(const std::string& file);

/// Opens woven pictures or a video, read unchanged.
[[nodiscard]] std::unique_ptr<ConvertInput> open_woven_input(const std::string& text,
                                                             const player::PictureOptions& options);

/// The conversion of views to frames: weaving for a rig, or tiles of a quilt.
struct FramesOfViews {
  std::unique_ptr<player::WeavingPipeline> pipeline;  ///< null for quilts
  frames::FrameGeometry geometry;
  frames::QuiltLayout layout;  ///< used for a quilt
};
[[nodiscard]] std::unique_ptr<ConvertInput> make_view_input(
    std::unique_ptr<frames::ViewInput> views, FramesOfViews frames, const std::string& name);

}  // namespace lenticule::tools
