// SPDX-License-Identifier: Apache-2.0
// Frames of a video file. A process of its own decodes them into a private ring; it may crash, hang
// or be taken over by the file, and is then replaced.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "frames/frame_source.h"
#include "player/sources/frame_range.h"

namespace lenticule::player {

struct VideoRequest {
  std::filesystem::path file;
  int slots = 8;                          ///< frames in memory, at least 4
  std::optional<int> stream = {};         ///< the first with pictures
  std::optional<FrameRange> frames = {};  ///< of the file
  /// Decode on into the next round, so that rewind() costs nothing. Without it rewind() starts a
  /// decoder, and its first frame is not there at once.
  bool plays_again = false;
  /// 4:2:0 and 4:2:2 are let through: the frames are quilts or the like and will be woven.
  bool before_weaving = false;
  /// Called with the size of the frames before memory for them is made; throws to refuse it.
  std::function<void(const frames::FrameGeometry&)> accept = nullptr;
  /// Fewer than `slots` frames are kept where they would take more; at least 4.
  uint64_t most_bytes = std::numeric_limits<uint64_t>::max();
  std::filesystem::path program = {};  ///< lenticule-video; empty = where it is installed
  /// A decoder that has a free slot and gives no sign of life for so long is killed.
  std::chrono::milliseconds patience{5000};
};

struct VideoStatistics {
  uint64_t restarts = 0;  ///< decoders that crashed or hung and were replaced
  uint64_t hangs = 0;     ///< those of them that had to be killed
  uint64_t broken = 0;    ///< frames and packets that the present decoder left out
  int64_t decoder = -1;   ///< its process, or -1
};

/// A FrameSource, one thread. pull() never blocks and never allocates but for a restart.
///
/// Every frame of the clip comes once, in order, also over a restart: the decoder goes on with the
/// frame after the last one that had arrived. A fourth restart within a minute, or a decoder that
/// says that the file cannot be decoded, is Failed after all frames that had arrived; failure() has
/// its last words. Frames that cannot be decoded are left out by the decoder, so that a damaged
/// clip is shorter than it was.
class VideoSource : public frames::FrameSource {
 public:
  [[nodiscard]] virtual VideoStatistics statistics() const = 0;
};

/// Has the stream's own size, whatever the panel's. Throws Error(Input) for what is no video,
/// cannot be decoded or has chroma of lower resolution (unless before_weaving), Error(Usage) for a
/// range or a stream that is none, Error(Failed) when ring or decoder cannot be had.
[[nodiscard]] std::unique_ptr<VideoSource> open_video(const VideoRequest& request);

}  // namespace lenticule::player
