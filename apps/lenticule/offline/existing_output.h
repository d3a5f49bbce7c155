// SPDX-License-Identifier: Apache-2.0
// What -o would replace: the film of another rig or scene is replaced only when --overwrite says
// so.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "apps/lenticule/offline/frame_output.h"

namespace lenticule::player {

inline constexpr const char* kOverwriteHelp =
    "replace what is there, also if it is the film of another rig or scene";

/// Returns what OutputRequest::made_from is: the names of the file and of its folder, which are the
/// same on every machine that has the project, and those of the camera's file if there is one.
[[nodiscard]] std::string made_from(const std::string& input, const std::string& camera = {});

// Each throws Error(Input) for a file that is there and is not what would be written again. All is
// well with --overwrite and --resume; what is resumed is looked at by whoever goes on with it.

/// FILE.lts or FILE.lts.part is no container, or one of other frames, another rig or another scene.
/// Another trim of the same rig is no other rig: rendering again is what takes a trim in.
void require_replaceable_film(const OutputRequest& request);
/// A picture of the range is no picture, or one of another size; pictures say nothing else.
void require_replaceable_pictures(const OutputRequest& request,
                                  const frames::FrameGeometry& geometry,
                                  const std::function<std::filesystem::path(uint64_t)>& file);
/// Any video that is there: it does not say what it was made from.
void require_replaceable_video(const OutputRequest& request);

}  // namespace lenticule::player
