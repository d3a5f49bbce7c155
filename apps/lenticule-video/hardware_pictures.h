// SPDX-License-Identifier: Apache-2.0
// Chooses a hardware decoder for a stream, and checks the pictures that it gives.
#pragma once

#include <string>
#include <vector>

#include "apps/lenticule-video/av_handles.h"
#include "apps/lenticule-video/hardware_decoders.h"

namespace lenticule::video {

struct HardwareChoice {
  std::string decoder;   ///< FFmpeg's name, "h264_v4l2m2m"; empty = none fits
  std::string obstacle;  ///< the reason why none fits
};

/// Chooses the decoder of the stream. Hardware decoders give 4:2:0 of 8 bits.
[[nodiscard]] HardwareChoice choose_hardware(const AVCodecParameters& stream,
                                             const std::vector<HardwareDecoder>& found);

/// Checks that a hardware decoder's picture is whole and has the stream's size, and removes the
/// rows and columns that fill its last blocks. Removes its colour tags, which drivers guess: those
/// of the stream are used. Returns the fault; empty if there is none.
[[nodiscard]] std::string adopt_picture(AVFrame& frame, const AVCodecParameters& stream);

}  // namespace lenticule::video
