// SPDX-License-Identifier: Apache-2.0
// What a stream says about its pixels, and whether they can become RGB here.
#pragma once

#include <optional>
#include <string>

#include "apps/lenticule-video/av_handles.h"
#include "apps/lenticule-video/pixel_layout.h"

namespace lenticule::video {

/// Pixel format and colour tags of a stream or of one of its frames.
struct PixelTags {
  AVPixelFormat format = AV_PIX_FMT_NONE;
  AVColorSpace matrix = AVCOL_SPC_UNSPECIFIED;
  AVColorRange range = AVCOL_RANGE_UNSPECIFIED;
  AVColorTransferCharacteristic transfer = AVCOL_TRC_UNSPECIFIED;
  AVChromaLocation site = AVCHROMA_LOC_UNSPECIFIED;
  int height = 0;  ///< decides on the matrix where none is stated: below 720 rows BT.601
  friend bool operator==(const PixelTags&, const PixelTags&) = default;
};

[[nodiscard]] PixelTags tags_of(const AVCodecParameters& stream);
/// What the frame leaves open is taken from the stream.
[[nodiscard]] PixelTags tags_of(const AVFrame& frame, const PixelTags& stream);

struct PixelVerdict {
  std::optional<PixelLayout> layout;  ///< empty: cannot be converted, see refusal
  std::string refusal;
  std::string sampling;  ///< "rgb", "grey", "4:4:4", "4:2:2", "4:2:0", ... or "unknown"
  int depth = 0;
  bool exact = false;  ///< each subpixel's code arrives as it was stored: 8-bit RGB or full grey
};

[[nodiscard]] PixelVerdict judge_pixels(const PixelTags& tags);

}  // namespace lenticule::video
