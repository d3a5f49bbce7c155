// SPDX-License-Identifier: Apache-2.0
// PixelVerdict states whether a stream's pixel format and tags can be converted to RGB.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <string>

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

struct PixelVerdict {
  std::optional<PixelLayout> layout;  ///< none: cannot be converted, see refusal
  std::string refusal;
  std::string sampling;  ///< "rgb", "grey", "4:4:4", "4:2:2", "4:2:0", ... or "unknown"
  int depth = 0;
  bool exact = false;  ///< each subpixel's code arrives as stored: 8-bit RGB or full-range grey
};

inline constexpr int kFirstHighDefinitionHeight = 720;
inline constexpr unsigned kUnreadable = AV_PIX_FMT_FLAG_PAL | AV_PIX_FMT_FLAG_BITSTREAM |
                                        AV_PIX_FMT_FLAG_HWACCEL | AV_PIX_FMT_FLAG_FLOAT |
                                        AV_PIX_FMT_FLAG_BAYER;

struct Weights {
  AVColorSpace matrix;
  double kr;
  double kb;
};
/// Kr and Kb of ITU-T H.273, table 4.
inline constexpr std::array kWeights = {
    Weights{AVCOL_SPC_BT709, 0.2126, 0.0722},   Weights{AVCOL_SPC_FCC, 0.30, 0.11},
    Weights{AVCOL_SPC_BT470BG, 0.299, 0.114},   Weights{AVCOL_SPC_SMPTE170M, 0.299, 0.114},
    Weights{AVCOL_SPC_SMPTE240M, 0.212, 0.087}, Weights{AVCOL_SPC_BT2020_NCL, 0.2627, 0.0593}};

/// Returns the weights of a known matrix; null for others.
inline const Weights* weights_of(AVColorSpace matrix, int height) {
  if (matrix == AVCOL_SPC_UNSPECIFIED)
    matrix = height < kFirstHighDefinitionHeight ? AVCOL_SPC_SMPTE170M : AVCOL_SPC_BT709;
  const auto* const found = std::ranges::find(kWeights, matrix, &Weights::matrix);
  return found == kWeights.end() ? nullptr : found;
}

/// Returns true for display-referred code values, which can be shown unchanged; linear light and
/// other curves cannot.
inline bool is_display_referred(AVColorTransferCharacteristic transfer) {
  constexpr std::array kOthers = {AVCOL_TRC_LINEAR,    AVCOL_TRC_LOG,      AVCOL_TRC_LOG_SQRT,
                                  AVCOL_TRC_SMPTE2084, AVCOL_TRC_SMPTE428, AVCOL_TRC_ARIB_STD_B67};
  return std::ranges::find(kOthers, transfer) == kOthers.end();
}

/// Returns the chroma position. If it is not stated, the one of MPEG-2 and later: aligned with
/// every second column.
inline ChromaSite site_of(AVChromaLocation location) {
  switch (location) {
    case AVCHROMA_LOC_CENTER:
      return {.across = 1, .down = 1};
    case AVCHROMA_LOC_TOPLEFT:
      return {.across = 0, .down = 0};
    case AVCHROMA_LOC_TOP:
      return {.across = 1, .down = 0};
    case AVCHROMA_LOC_BOTTOMLEFT:
      return {.across = 0, .down = 2};
    case AVCHROMA_LOC_BOTTOM:
      return {.across = 1, .down = 2};
    default:
      return {.across = 0, .down = 1};
  }
}

inline bool has_flag(const AVPixFmtDescriptor& pixels, uint64_t flag) {
  return (pixels.flags & flag) != 0;
}

inline bool is_full_range_by_name(AVPixelFormat format) {
  return format == AV_PIX_FMT_YUVJ420P || format == AV_PIX_FMT_YUVJ422P ||
         format == AV_PIX_FMT_YUVJ444P || format == AV_PIX_FMT_YUVJ440P ||
         format == AV_PIX_FMT_YUVJ411P;
}

inline ColourModel model_of(const AVPixFmtDescriptor& pixels) {
  if (has_flag(pixels, AV_PIX_FMT_FLAG_RGB)) return ColourModel::Rgb;
  return pixels.nb_components < 3 ? ColourModel::Grey : ColourModel::Yuv;
}

inline std::string sampling_name(const AVPixFmtDescriptor& pixels) {
  if (has_flag(pixels, AV_PIX_FMT_FLAG_RGB | AV_PIX_FMT_FLAG_PAL)) return "rgb";
  if (pixels.nb_components < 3) return "grey";
  const int x = pixels.log2_chroma_w;
  const int y = pixels.log2_chroma_h;
  if (x == 0) return y == 0 ? "4:4:4" : "4:4:0";
  if (x == 1) return y == 0 ? "4:2:2" : "4:2:0";
  return y == 0 ? "4:1:1" : "4:1:0";
}

inline PixelLayout plain_layout(const AVPixFmtDescriptor& pixels) {
  PixelLayout layout;
  layout.model = model_of(pixels);
  layout.big_endian = has_flag(pixels, AV_PIX_FMT_FLAG_BE);
  for (size_t i = 0; i < layout.components.size(); ++i) {
    const AVComponentDescriptor& c = pixels.comp[layout.model == ColourModel::Grey ? 0 : i];
    layout.components[i] = {
        .plane = c.plane, .step = c.step, .offset = c.offset, .shift = c.shift, .depth = c.depth};
  }
  if (layout.model != ColourModel::Yuv) return layout;
  layout.chroma_shift_x = pixels.log2_chroma_w;
  layout.chroma_shift_y = pixels.log2_chroma_h;
  return layout;
}

inline std::string named(const char* name) { return name != nullptr ? name : "without a name"; }

/// Changes Y'CbCr planes that hold G, B, R (identity matrix) into an RGB layout.
inline void turn_into_rgb(PixelLayout& layout) {
  std::rotate(layout.components.begin(), layout.components.begin() + 2, layout.components.end());
  layout.model = ColourModel::Rgb;
}

inline std::string refuse_or_colour(const PixelTags& tags, PixelLayout& layout) {
  if (!is_display_referred(tags.transfer))
    return "transfer function " + named(av_color_transfer_name(tags.transfer)) +
           " is not made for displays";
  if (layout.model == ColourModel::Rgb) return {};
  layout.full_range = tags.range == AVCOL_RANGE_JPEG || is_full_range_by_name(tags.format);
  if (layout.model == ColourModel::Grey) {
    layout.full_range = tags.range != AVCOL_RANGE_MPEG;
    return {};
  }
  if (tags.matrix == AVCOL_SPC_RGB && !layout.subsampled()) {
    turn_into_rgb(layout);
    return {};
  }
  const Weights* const weights = weights_of(tags.matrix, tags.height);
  if (weights == nullptr)
    return "colour matrix " + named(av_color_space_name(tags.matrix)) + " is not known";
  layout.kr = weights->kr;
  layout.kb = weights->kb;
  layout.site = site_of(tags.site);
  return {};
}

template <typename Tag>
Tag stated_or(Tag stated, Tag unstated, Tag otherwise) {
  return stated != unstated ? stated : otherwise;
}

[[nodiscard]] inline PixelTags tags_of(const AVCodecParameters& stream) {
  return {.format = static_cast<AVPixelFormat>(stream.format),
          .matrix = stream.color_space,
          .range = stream.color_range,
          .transfer = stream.color_trc,
          .site = stream.chroma_location,
          .height = stream.height};
}

/// Returns the frame's tags; missing ones are taken from the stream.
[[nodiscard]] inline PixelTags tags_of(const AVFrame& frame, const PixelTags& stream) {
  return {.format = static_cast<AVPixelFormat>(frame.format),
          .matrix = stated_or(frame.colorspace, AVCOL_SPC_UNSPECIFIED, stream.matrix),
          .range = stated_or(frame.color_range, AVCOL_RANGE_UNSPECIFIED, stream.range),
          .transfer = stated_or(frame.color_trc, AVCOL_TRC_UNSPECIFIED, stream.transfer),
          .site = stated_or(frame.chroma_location, AVCHROMA_LOC_UNSPECIFIED, stream.site),
          .height = frame.height};
}

[[nodiscard]] inline PixelVerdict evaluate_pixels(const PixelTags& tags) {
  PixelVerdict verdict;
  verdict.sampling = "unknown";
  const AVPixFmtDescriptor* const pixels = av_pix_fmt_desc_get(tags.format);
  if (pixels == nullptr) {
    verdict.refusal = "its pixel format is not known";
    return verdict;
  }
  verdict.sampling = sampling_name(*pixels);
  verdict.depth = pixels->comp[0].depth;
  const bool shallow_luma = verdict.depth < 8 && model_of(*pixels) != ColourModel::Rgb;
  if ((pixels->flags & kUnreadable) != 0 || verdict.depth > 16 || shallow_luma) {
    verdict.refusal = "pixel format " + named(pixels->name) + " cannot be read";
    return verdict;
  }
  PixelLayout layout = plain_layout(*pixels);
  verdict.refusal = refuse_or_colour(tags, layout);
  if (!verdict.refusal.empty()) return verdict;
  const bool bytes = std::all_of(layout.components.begin(), layout.components.end(),
                                 [](const PixelComponent& c) { return c.depth == 8; });
  verdict.exact = bytes && layout.model != ColourModel::Yuv && layout.full_range;
  if (layout.model == ColourModel::Rgb) verdict.sampling = "rgb";
  verdict.layout = layout;
  return verdict;
}

}  // namespace lenticule::video
