// SPDX-License-Identifier: Apache-2.0
// find_video_program locates lenticule-video, probe_video returns its report about a file.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "player/sources/video_probe.h"

namespace lenticule::player {

/// Returns the program's path: beside this program, or in ../libexec/lenticule if installed. Throws
/// Error(Failed).
[[nodiscard]] std::filesystem::path find_video_program();

/// Runs `lenticule-video probe` for at most half a minute, or returns the cached report if the file
/// is unchanged. Throws Error(Input) with the program's message if the file is not a video,
/// Error(Failed) if the program does not work. An empty `program` is searched for.
[[nodiscard]] std::vector<VideoStream> probe_video(const std::filesystem::path& file,
                                                   const std::filesystem::path& program = {});

}  // namespace lenticule::player
