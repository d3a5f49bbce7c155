// SPDX-License-Identifier: Apache-2.0
// Interprets a camera's code values: V4L2's colour space, Y'CbCr encoding, quantization and
// transfer function, with V4L2's rules for values that a driver leaves open (the kernel's
// documentation, "Defining Colorspaces" and the macros V4L2_MAP_*_DEFAULT).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace lenticule::calib {

/// ColourCoding holds the driver's values; 0 is "default" in every field. Values that V4L2 does not
/// define count as 0.
struct ColourCoding {
  uint32_t colorspace = 0;
  uint32_t ycbcr_enc = 0;
  uint32_t quantization = 0;
  uint32_t xfer_func = 0;
};

/// Samples is the kind of samples. Bayer and decoded JPEG are Rgb.
enum class Samples { Rgb, Ycbcr, Luma };

/// Resolves all defaults; the result still has V4L2's numbers. Luma alone is full range unless the
/// driver states otherwise: V4L2's rule does not cover it, but sensors and the kernel's test driver
/// deliver full range.
[[nodiscard]] ColourCoding resolved(ColourCoding coding, Samples samples);

/// CodeScale maps codes of `bits` bits to encoded values: black is 0, white is 1.
struct CodeScale {
  double black = 0.0;
  double per_code = 1.0;         ///< scale of luma and R'G'B'
  double chroma_middle = 0.0;    ///< the code of no colour
  double chroma_per_code = 1.0;  ///< Cb and Cr range from -1/2 to 1/2
};
[[nodiscard]] CodeScale code_scale(const ColourCoding& resolved_coding, int bits);

/// YcbcrMatrix: R' = Y' + red_cr Cr, G' = Y' + green_cb Cb + green_cr Cr, B' = Y' + blue_cb Cb.
/// Constant luminance is treated like non-constant luminance.
struct YcbcrMatrix {
  double red_cr = 0.0;
  double green_cb = 0.0;
  double green_cr = 0.0;
  double blue_cb = 0.0;
};
[[nodiscard]] YcbcrMatrix ycbcr_matrix(const ColourCoding& resolved_coding);

/// Returns the linear light of an encoded value in [0, 1], by the formula. BT.2084 maps 10000 cd/m2
/// to 1.
[[nodiscard]] double linear_by_formula(uint32_t resolved_xfer_func, double encoded);

/// TransferCurve tabulates linear_by_formula(); encoded values outside [0, 1] are clipped.
/// Immutable.
///
/// Thread safety: any thread.
class TransferCurve {
 public:
  explicit TransferCurve(uint32_t resolved_xfer_func);

  [[nodiscard]] float operator()(float encoded) const noexcept {
    const float held = encoded > 0.0F ? (encoded < 1.0F ? encoded : 1.0F) : 0.0F;
    const float place = held * kSteps;
    const auto step = static_cast<size_t>(place);
    const float below = table_[step];
    return below + (table_[step + 1] - below) * (place - static_cast<float>(step));
  }

 private:
  static constexpr int kSteps = 4096;
  std::vector<float> table_;  // one entry more than there are steps, and the last entry twice
};

}  // namespace lenticule::calib
