// SPDX-License-Identifier: Apache-2.0
// What lenticule convert reads: frames of one size, woven already or made of views on the way.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "frames/frame.h"
#include "frames/sequence/sequence_info.h"
#include "frames/views_input/view_input.h"
#include "player/sources/content_open.h"
#include "player/sources/loom.h"

namespace lenticule::player {

enum class ReadResult { Ok, Damaged, End };

/// One thread.
class ConvertInput {
 public:
  virtual ~ConvertInput() = default;
  /// If it is known beforehand.
  [[nodiscard]] virtual std::optional<uint64_t> count() const = 0;
  /// What is known besides the pixels; the geometry is that of the frames.
  [[nodiscard]] virtual frames::SequenceInfo info() const = 0;
  /// Frame `number`, counted from 0; numbers only grow, apart from repeating the last. Throws
  /// Error(Input) for what cannot be read, Error(Failed) when nothing comes any more.
  [[nodiscard]] virtual ReadResult read(uint64_t number, frames::WovenFrame& frame) = 0;
  /// What its sources left out or replaced in what was read so far.
  [[nodiscard]] virtual frames::FrameDamage damage() const { return {}; }
};

/// The woven frames of a container, in any order.
[[nodiscard]] std::unique_ptr<ConvertInput> open_container_input(const std::string& file);

/// Woven pictures or a video, as they are.
[[nodiscard]] std::unique_ptr<ConvertInput> open_woven_input(const std::string& text,
                                                             const PictureRequest& how);

/// How views become frames: woven for a rig, or tiles of a quilt.
struct FramesOfViews {
  std::unique_ptr<Loom> loom;  ///< null for quilts
  frames::FrameGeometry geometry;
  frames::QuiltLayout layout;  ///< of a quilt
};
[[nodiscard]] std::unique_ptr<ConvertInput> make_view_input(
    std::unique_ptr<frames::ViewInput> views, FramesOfViews frames, const std::string& name);

}  // namespace lenticule::player
