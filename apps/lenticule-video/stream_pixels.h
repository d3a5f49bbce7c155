// SPDX-License-Identifier: Apache-2.0
// PixelVerdict states whether a stream's pixel format and tags can be converted to RGB.
#pragma once

#include <optional>
#include <string>

#include "apps/lenticule-video/av_handles.h"
#include "apps/lenticule-video/pixel_convert.h"

namespace lenticule::video {

/// Pixel format and colour tags of a stream or of one of its frames.
struct PixelTags {
  AVPixelFormat format = AV_PIX_FMT_NONE;
  AVColorSpace matrix = AVCOL_SPC_UNSPECIFIED;
  AVColorRange range = AVCOL_RANGE_UNSPECIFIED;
  AVColorTransferCharacteristic transfer = AVCOL_TRC_UNSPECIFIED;
  AVChromaLocation site = AVCHROMA_LOC_UNSPECIFIED;
  int height = 0;  ///< chooses the matrix if none is stated: BT.601 below 720 rows
  friend bool operator==(const PixelTags&, const PixelTags&) = default;
};

[[nodiscard]] PixelTags tags_of(const AVCodecParameters& stream);
/// Returns the frame's tags; missing ones are taken from the stream.
[[nodiscard]] PixelTags tags_of(const AVFrame& frame, const PixelTags& stream);

struct PixelVerdict {
  std::optional<PixelLayout> layout;  ///< none: cannot be converted, see refusal
  std::string refusal;
  std::string sampling;  ///< "rgb", "grey", "4:4:4", "4:2:2", "4:2:0", ... or "unknown"
  int depth = 0;
  bool exact = false;  ///< each subpixel's code arrives as stored: 8-bit RGB or full-range grey
};

[[nodiscard]] PixelVerdict evaluate_pixels(const PixelTags& tags);

}  // namespace lenticule::video
