// SPDX-License-Identifier: Apache-2.0
// Where lenticule convert writes, besides what rendered frames can go to: videos, quilts with their
// layout in the name, a picture per view.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "apps/lenticule/offline/frame_output.h"
#include "frames/quilt.h"

namespace lenticule::player {

struct ConvertTarget {
  OutputRequest request;
  /// The frames are quilts of this layout; empty for woven frames.
  std::optional<frames::QuiltLayout> quilt = std::nullopt;
};

/// "views:v%02d.png" and "views:view%02d/%05d.png".
[[nodiscard]] bool is_view_files(const std::string& target);

/// What the target will be called: a quilt's layout is added. Throws Error(Usage) for a name that
/// says another one.
[[nodiscard]] std::string target_name(const ConvertTarget& target);

/// Throws what open_output() throws, and Error(Usage) for a video or pictures per view that are
/// asked for what they cannot do. A video that is not finished leaves nothing.
[[nodiscard]] std::unique_ptr<FrameOutput> open_convert_output(const ConvertTarget& target);

}  // namespace lenticule::player
