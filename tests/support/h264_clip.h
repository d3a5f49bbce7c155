// SPDX-License-Identifier: Apache-2.0
// write_h264_clip writes H.264 in 4:2:0 without an encoder: every macroblock holds its samples as
// they are (I_PCM, ITU-T H.264 section 7.3.5), so that a decoder gives them back exactly.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace lenticule::test {

/// A picture of 4:2:0: planes Y, Cb and Cr without gaps. Its sides are even.
struct Picture420 {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> samples;
};

struct H264Clip {
  std::filesystem::path file;  ///< an FLV file
  int milliseconds = 40;       ///< duration of a picture
  unsigned key_interval = 1;   ///< the pictures between key frames are copies of the last one
  bool full_range = false;     ///< states the range 0..255; otherwise none is stated
  /// Arrangement of two eyes that an SEI message states: 3 beside, 4 above each other; 0: none.
  unsigned packing = 0;
  bool right_first = false;  ///< the message says that the right eye's picture is the first
};

/// Writes pictures of one size.
void write_h264_clip(const H264Clip& clip, const std::vector<Picture420>& pictures);

}  // namespace lenticule::test
