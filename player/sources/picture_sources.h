// SPDX-License-Identifier: Apache-2.0
// Pictures of any size as a FrameSource, whatever is in them: a picture, a pattern, a video, a
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

/// Of what plays: a picture of more pixels is refused before anything is allocated for it. A
/// decoder of video holds many pictures.
inline constexpr uint64_t kMostPlayedPixels = uint64_t{1} << 27;       ///< 16384 x 8192: 384 MiB
inline constexpr uint64_t kMostPlayedVideoPixels = uint64_t{1} << 26;  ///< 8192 x 8192
/// Decoded pictures kept ahead take no more than that, or two pictures.
inline constexpr uint64_t kMostBytesAhead = uint64_t{1} << 30;

/// How sources are opened.
struct PictureRequest {
  std::optional<FrameRange> frames = std::nullopt;  ///< of a pattern, container or video
  /// Where the first round begins, if the kind can: a hint.
  uint64_t first_frame = 0;
  int pool_frames = 3;
  int decoder_threads = 1;
  bool plays_again = false;
  /// Views: chroma of lower resolution is let through, and orientation tags are followed.
  bool before_weaving = true;
  /// Of woven frames: another size is refused before anything is allocated.
  std::optional<frames::FrameGeometry> size = std::nullopt;
  bool plays = false;  ///< the limits above hold
};

/// Throws Error(Usage) and Error(Input) as the kinds do.
[[nodiscard]] std::unique_ptr<frames::FrameSource> open_pictures(const std::string& text,
                                                                 const PictureRequest& request);

/// The files of a pattern in a range, all of them. Throws Error(Usage) for one picture,
/// Error(Input) that names the first file that is missing.
[[nodiscard]] std::vector<std::filesystem::path> files_in_range(const std::string& text,
                                                                FrameRange range);

/// As many as a machine has for decoding beside a player: one core is left to that.
[[nodiscard]] int decoding_threads();
/// As many as a command takes that does nothing else meanwhile.
[[nodiscard]] int all_threads();

}  // namespace lenticule::player
