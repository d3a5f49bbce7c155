// SPDX-License-Identifier: Apache-2.0
// Where lenticule-video is, and what it says about a file.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "player/sources/video_probe.h"

namespace lenticule::player {

/// Beside this program, or in ../libexec/lenticule where it is installed. Throws Error(Failed).
[[nodiscard]] std::filesystem::path find_video_program();

/// True for the names of files that lenticule-video reads: .mkv, .webm, .mp4, .mov, .avi, .nut, ...
[[nodiscard]] bool looks_like_video(const std::filesystem::path& file);

/// Runs `lenticule-video probe`, half a minute at most, or remembers what it said about the same
/// state of the same file. Throws Error(Input) in its words when the
/// file is no video, Error(Failed) when the program does not work. An empty `program` is searched
/// for.
[[nodiscard]] std::vector<VideoStream> probe_video(const std::filesystem::path& file,
                                                   const std::filesystem::path& program = {});

}  // namespace lenticule::player
