// SPDX-License-Identifier: Apache-2.0
// What lenticule-video says, read without trust: the process that wrote it may have been taken over
// by the file that it looked at.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "frames/frame.h"
#include "frames/image_io.h"
#include "frames/rational.h"

namespace lenticule::player {

/// How two eyes share the frames of a stream, as its tag says.
struct VideoStereo {
  std::string layout;        ///< FFmpeg's name: "side by side", "top and bottom", ...
  bool right_first = false;  ///< the right eye's picture is the left or the upper one
};

struct VideoStream {
  int index = 0;
  frames::FrameGeometry geometry;    ///< within the ring's limits
  std::optional<frames::Rate> rate;  ///< the stream's average
  std::optional<uint64_t> frames;    ///< as the container claims
  std::optional<double> duration_s;
  std::optional<uint64_t> expected_frames;  ///< as the container, or its duration, claims
  double pixel_aspect = 1.0;                ///< a pixel's width over its height
  /// How frames are to be turned; empty for angles other than quarter turns.
  std::optional<frames::Orientation> orientation = frames::Orientation::Upright;
  std::optional<VideoStereo> stereo;  ///< what a tag says about two eyes
  std::string codec;                  ///< escaped, as all text here
  std::string pixel_format;           ///< FFmpeg's name
  std::string sampling;               ///< "rgb", "grey", "4:4:4", "4:2:0", ...
  bool exact = false;                 ///< every code arrives as it was stored
  bool full_chroma = false;           ///< RGB, grey or 4:4:4: subpixels keep their own colours
  std::string refusal;                ///< why it cannot be decoded; empty if it can
};

/// Throws Error(Input) "source: cause" for anything but a probe's report whose every stream has
/// sizes and numbers that make sense, and for one without streams.
[[nodiscard]] std::vector<VideoStream> parse_video_probe(std::string_view text,
                                                         const std::string& source);

/// A line that a decoder prints while it works.
struct VideoEvent {
  enum class Kind { Position, Broken, Clip, Other };
  Kind kind = Kind::Other;
  uint64_t frame = 0;           ///< of a Position: in the file
  std::optional<int64_t> time;  ///< and its time stamp
  uint64_t broken = 0;          ///< frames and packets left out, or faulty, so far
  uint64_t left_out = 0;        ///< of a Clip: in this round; `frame` is how many frames came
};
/// Empty if the line is not such an event. Never throws for what the line holds.
[[nodiscard]] std::optional<VideoEvent> parse_video_event(std::string_view line);

}  // namespace lenticule::player
