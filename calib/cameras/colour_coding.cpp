// SPDX-License-Identifier: Apache-2.0
#include "calib/cameras/colour_coding.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cmath>

#include "frames/srgb.h"

namespace lenticule::calib {
namespace {

struct LumaWeights {
  double red;
  double blue;
};

LumaWeights luma_weights(uint32_t encoding) {
  switch (encoding) {
    case V4L2_YCBCR_ENC_709:
    case V4L2_YCBCR_ENC_XV709:
      return {.red = 0.2126, .blue = 0.0722};
    case V4L2_YCBCR_ENC_BT2020:
    case V4L2_YCBCR_ENC_BT2020_CONST_LUM:
      return {.red = 0.2627, .blue = 0.0593};
    case V4L2_YCBCR_ENC_SMPTE240M:
      return {.red = 0.212, .blue = 0.087};
    default:
      return {.red = 0.299, .blue = 0.114};
  }
}

/// Evaluates a curve with a linear part near black and a power above, as in BT.709 and SMPTE 240M.
double camera_curve(double encoded, double slope, double knee, double lift) {
  if (encoded < knee) return encoded / slope;
  return std::pow((encoded + lift) / (1.0 + lift), 1.0 / 0.45);
}

/// Evaluates SMPTE ST 2084.
double perceptual_quantizer(double encoded) {
  constexpr double kM1 = 2610.0 / 16384.0;
  constexpr double kM2 = 2523.0 / 4096.0 * 128.0;
  constexpr double kC1 = 3424.0 / 4096.0;
  constexpr double kC2 = 2413.0 / 4096.0 * 32.0;
  constexpr double kC3 = 2392.0 / 4096.0 * 32.0;
  const double root = std::pow(encoded, 1.0 / kM2);
  return std::pow(std::max(root - kC1, 0.0) / (kC2 - kC3 * root), 1.0 / kM1);
}

/// Returns a number that V4L2 defines, or 0.
uint32_t known(uint32_t number, uint32_t largest) {
  return number <= largest ? number : 0;
}

}  // namespace

ColourCoding resolved(ColourCoding coding, Samples samples) {
  coding.colorspace = known(coding.colorspace, V4L2_COLORSPACE_DCI_P3);
  coding.ycbcr_enc = known(coding.ycbcr_enc, V4L2_YCBCR_ENC_SMPTE240M);
  coding.quantization = known(coding.quantization, V4L2_QUANTIZATION_LIM_RANGE);
  coding.xfer_func = known(coding.xfer_func, V4L2_XFER_FUNC_SMPTE2084);
  // A webcam is neither SDTV nor HDTV.
  if (coding.colorspace == V4L2_COLORSPACE_DEFAULT)
    coding.colorspace = V4L2_MAP_COLORSPACE_DEFAULT(false, false);
  const uint32_t space = coding.colorspace;
  if (coding.ycbcr_enc == V4L2_YCBCR_ENC_DEFAULT)
    coding.ycbcr_enc = V4L2_MAP_YCBCR_ENC_DEFAULT(space);
  if (coding.xfer_func == V4L2_XFER_FUNC_DEFAULT)
    coding.xfer_func = V4L2_MAP_XFER_FUNC_DEFAULT(space);
  if (coding.quantization == V4L2_QUANTIZATION_DEFAULT) {
    // Raw sensors have no headroom, although V4L2's rule assigns some to their Y'CbCr.
    const bool full = samples != Samples::Ycbcr || space == V4L2_COLORSPACE_RAW;
    coding.quantization = V4L2_MAP_QUANTIZATION_DEFAULT(full, space, coding.ycbcr_enc);
  }
  return coding;
}

CodeScale code_scale(const ColourCoding& resolved_coding, int bits) {
  const double largest = std::ldexp(1.0, bits) - 1.0;
  const double step = std::ldexp(1.0, bits - 8);  // limited range is defined for 8 bits
  if (resolved_coding.quantization == V4L2_QUANTIZATION_FULL_RANGE)
    return {.black = 0.0,
            .per_code = 1.0 / largest,
            .chroma_middle = 128.0 * step,
            .chroma_per_code = 1.0 / largest};
  return {.black = 16.0 * step,
          .per_code = 1.0 / (219.0 * step),
          .chroma_middle = 128.0 * step,
          .chroma_per_code = 1.0 / (224.0 * step)};
}

YcbcrMatrix ycbcr_matrix(const ColourCoding& resolved_coding) {
  const auto [red, blue] = luma_weights(resolved_coding.ycbcr_enc);
  const double green = 1.0 - red - blue;
  return {.red_cr = 2.0 * (1.0 - red),
          .green_cb = -2.0 * blue * (1.0 - blue) / green,
          .green_cr = -2.0 * red * (1.0 - red) / green,
          .blue_cb = 2.0 * (1.0 - blue)};
}

double linear_by_formula(uint32_t resolved_xfer_func, double encoded) {
  switch (resolved_xfer_func) {
    case V4L2_XFER_FUNC_NONE:
      return encoded;
    case V4L2_XFER_FUNC_SRGB:
      return frames::linear_from_srgb(encoded);
    case V4L2_XFER_FUNC_OPRGB:
      return std::pow(encoded, 563.0 / 256.0);
    case V4L2_XFER_FUNC_SMPTE240M:
      return camera_curve(encoded, 4.0, 0.0913, 0.1115);
    case V4L2_XFER_FUNC_DCI_P3:
      return std::pow(encoded, 2.6);
    case V4L2_XFER_FUNC_SMPTE2084:
      return perceptual_quantizer(encoded);
    default:
      return camera_curve(encoded, 4.5, 0.081, 0.099);
  }
}

TransferCurve::TransferCurve(uint32_t resolved_xfer_func) {
  table_.reserve(kSteps + 2);
  for (int i = 0; i <= kSteps; ++i)
    table_.push_back(static_cast<float>(linear_by_formula(resolved_xfer_func, i * 1.0 / kSteps)));
  table_.push_back(table_.back());
}

}  // namespace lenticule::calib
