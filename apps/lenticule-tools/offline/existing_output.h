// SPDX-License-Identifier: Apache-2.0
// Checks existing files at -o: frames of another rig or scene are replaced only with --overwrite.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "apps/lenticule-tools/offline/frame_output.h"

namespace lenticule::tools {

inline constexpr const char* kOverwriteHelp =
    "replace existing output, even if it is of another rig or scene";

/// Returns the value of OutputRequest::made_from: the names of the file and of its folder, which
/// are the same on every machine that has the project, and those of the camera's file if there is
/// one.
[[nodiscard]] std::string made_from(const std::string& input, const std::string& camera = {});

// The functions throw Error(Input) if an existing file is not a result of the same command. With
// --overwrite or --resume they accept any file; when resuming, the output itself checks the file.

/// Refuses FILE.lts or FILE.lts.part that is not a container, or has other frames, another rig or
/// another scene. Another trim of the same rig is accepted, because rendering again is how a new
/// trim takes effect.
void require_replaceable_film(const OutputRequest& request);
/// Refuses a file of the range that is not a picture or has another size; pictures contain no other
/// metadata.
void require_replaceable_pictures(const OutputRequest& request,
                                  const frames::FrameGeometry& geometry,
                                  const std::function<std::filesystem::path(uint64_t)>& file);
/// Refuses any existing video, because it does not state how it was made.
void require_replaceable_video(const OutputRequest& request);

}  // namespace lenticule::tools
