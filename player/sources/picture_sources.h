// SPDX-License-Identifier: Apache-2.0
// open_pictures opens pictures of any size as a FrameSource: a picture, a pattern, a video, or a
// container of views.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "frames/frame_source.h"
#include "player/sources/frame_range.h"

namespace lenticule::player {

/// Limits for playback: a picture with more pixels is refused before memory is allocated for it. A
/// video decoder holds many pictures, so its limit is lower.
inline constexpr uint64_t kMostPlayedPixels = uint64_t{1} << 27;       ///< 16384 x 8192: 384 MiB
inline constexpr uint64_t kMostPlayedVideoPixels = uint64_t{1} << 26;  ///< 8192 x 8192
/// Limit of the pictures decoded ahead; two pictures are always allowed.
inline constexpr uint64_t kMostBytesAhead = uint64_t{1} << 30;

/// Options of open_pictures.
struct PictureRequest {
  std::optional<FrameRange> frames = std::nullopt;  ///< frames of a pattern, container or video
  /// First frame of the first round. Kinds of source that cannot start there ignore it.
  uint64_t first_frame = 0;
  int pool_frames = 3;
  int decoder_threads = 1;
  bool plays_again = false;
  /// Views: accepts subsampled chroma and applies orientation tags.
  bool before_weaving = true;
  /// Size of woven frames: another size is refused before memory is allocated.
  std::optional<frames::FrameGeometry> size = std::nullopt;
  bool plays = false;  ///< applies the playback limits above
  /// Decodes videos in hardware where a device can.
  bool hardware = false;
};

/// Throws Error(Usage) and Error(Input) as the functions of the individual kinds do.
[[nodiscard]] std::unique_ptr<frames::FrameSource> open_pictures(const std::string& text,
                                                                 const PictureRequest& request);

/// Returns all files of a pattern in a range. Throws Error(Usage) for a single picture,
/// Error(Input) that names the first missing file.
[[nodiscard]] std::vector<std::filesystem::path> files_in_range(const std::string& text,
                                                                FrameRange range);

/// Returns the number of decoding threads beside a player; one core is left to the player.
[[nodiscard]] int decoding_threads();
/// Returns the number of threads for a command that does nothing else meanwhile.
[[nodiscard]] int all_threads();

}  // namespace lenticule::player
