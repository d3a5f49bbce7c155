// SPDX-License-Identifier: Apache-2.0
// Output of lenticule convert beyond the targets of rendered frames: videos, quilts with the layout
// in the name, one picture per view.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "apps/lenticule-tools/offline/frame_output.h"
#include "frames/quilt.h"

namespace lenticule::tools {

struct ConvertTarget {
  OutputRequest request;
  /// The frames are quilts of this layout; none for woven frames.
  std::optional<frames::QuiltLayout> quilt = std::nullopt;
};

/// Returns true for "views:v%02d.png" and "views:view%02d/%05d.png".
[[nodiscard]] bool is_view_files(const std::string& target);

/// Returns the name of the target with a quilt's layout added. Throws Error(Usage) if the name
/// states another layout.
[[nodiscard]] std::string target_name(const ConvertTarget& target);

/// Opens the output. Throws the errors of open_output(), and Error(Usage) for options that a video
/// or pictures per view do not support. An unfinished video is removed.
[[nodiscard]] std::unique_ptr<FrameOutput> open_convert_output(const ConvertTarget& target);

}  // namespace lenticule::tools
