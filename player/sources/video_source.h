// SPDX-License-Identifier: Apache-2.0
// VideoSource delivers the frames of a video file. A separate process decodes them into a private
// ring; it is replaced if it crashes, hangs or is taken over by the file.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>

#include "frames/frame_source.h"
#include "player/sources/source_spec.h"

namespace lenticule::player {

struct VideoRequest {
  std::filesystem::path file;
  int slots = 8;                          ///< frames in memory, at least 4
  std::optional<int> stream = {};         ///< default: the first stream with pictures
  std::optional<FrameRange> frames = {};  ///< frames of the file
  /// Continues decoding into the next round, so that rewind() is immediate. Otherwise rewind()
  /// starts a decoder, and its first frame comes later.
  bool plays_again = false;
  /// Accepts 4:2:0 and 4:2:2: the frames are quilts or the like and will be woven.
  bool before_weaving = false;
  /// Called with the size of the frames before memory is allocated for them; throws to refuse it.
  std::function<void(const frames::FrameGeometry&)> accept = nullptr;
  /// Limits the memory: fewer than `slots` frames are kept if they would exceed it; at least 4.
  uint64_t most_bytes = std::numeric_limits<uint64_t>::max();
  /// Lets the decoder use a device of the machine for 4:2:0 of 8 bits, until one has failed.
  bool hardware = false;
  std::filesystem::path program = {};  ///< lenticule-video; empty = search for it
  /// Timeout without progress after which a decoder that has a free slot is killed.
  std::chrono::milliseconds timeout{5000};
};

struct VideoStatistics {
  uint64_t restarts = 0;  ///< decoders that crashed or hung and were replaced
  uint64_t hangs = 0;     ///< replaced decoders that had to be killed
  uint64_t broken = 0;    ///< frames and packets that the present decoder left out
  int64_t decoder = -1;   ///< its process id, or -1
};

/// pull() never blocks, and allocates only for a restart. Thread safety: one thread.
///
/// Frames have the numbers of their time stamps at rate(). Every frame of the clip comes in order,
/// and again until the number of the next one, also after a restart: the new decoder continues with
/// the frame after the last one that had arrived. After a fourth restart within a minute, or
/// if the decoder reports that the file cannot be decoded, the source delivers all frames that had
/// arrived and is then Failed; failure() returns the decoder's last message. The decoder leaves out
/// frames that cannot be decoded; the one before stays in their place.
class VideoSource : public frames::FrameSource {
 public:
  [[nodiscard]] virtual VideoStatistics statistics() const = 0;
};

/// Opens a video. Its frames have the stream's own size, independent of the panel's. Throws
/// Error(Input) if the file is not a video, cannot be decoded or has subsampled chroma (unless
/// before_weaving), Error(Usage) for an invalid range or stream, Error(Failed) if the ring or the
/// decoder cannot be created.
[[nodiscard]] std::unique_ptr<VideoSource> open_video(const VideoRequest& request);

}  // namespace lenticule::player
