// SPDX-License-Identifier: Apache-2.0
// PixelUnpacker converts a camera's bytes to pictures in linear light: the format's layout says
// where the codes are, its colour coding which light they mean.
#pragma once

#include <fmt/format.h>
#include <linux/videodev2.h>
#include <turbojpeg.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "calib/camera.h"
#include "frames/capture/pixel_layout.h"
#include "frames/srgb.h"

namespace lenticule::calib {

using namespace frames::capture;

/// Evaluates a curve with a linear part near black and a power above, as in BT.709 and SMPTE 240M.
inline double camera_curve(double encoded, double slope, double knee, double lift) {
  if (encoded < knee) return encoded / slope;
  return std::pow((encoded + lift) / (1.0 + lift), 1.0 / 0.45);
}

/// Evaluates SMPTE ST 2084.
inline double perceptual_quantizer(double encoded) {
  constexpr double kM1 = 2610.0 / 16384.0;
  constexpr double kM2 = 2523.0 / 4096.0 * 128.0;
  constexpr double kC1 = 3424.0 / 4096.0;
  constexpr double kC2 = 2413.0 / 4096.0 * 32.0;
  constexpr double kC3 = 2392.0 / 4096.0 * 32.0;
  const double root = std::pow(encoded, 1.0 / kM2);
  return std::pow(std::max(root - kC1, 0.0) / (kC2 - kC3 * root), 1.0 / kM1);
}

/// Returns the linear light of an encoded value in [0, 1], by the formula. BT.2084 maps 10000 cd/m2
/// to 1.
[[nodiscard]] inline double linear_by_formula(uint32_t resolved_xfer_func, double encoded) {
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

/// TransferCurve tabulates linear_by_formula(); encoded values outside [0, 1] are clipped.
/// Immutable.
///
/// Thread safety: any thread.
class TransferCurve {
 public:
  explicit TransferCurve(uint32_t resolved_xfer_func) {
    table_.reserve(kSteps + 2);
    for (int i = 0; i <= kSteps; ++i)
      table_.push_back(static_cast<float>(linear_by_formula(resolved_xfer_func, i * 1.0 / kSteps)));
    table_.push_back(table_.back());
  }

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

/// PixelUnpacker supports GREY, Y16, Y12, Y10 (one channel), 8-bit Bayer (RGGB, GRBG, BA81, GBRG;
/// interpolated bilinearly in linear light), YUYV, UYVY, NV12 (colours repeated, not interpolated),
/// RGB3, BGR3, MJPG, JPEG. It does not convert between colour primaries: R, G, B are the camera's
/// own. Codes below black give light 0, codes above white give light 1.
///
/// Thread safety: one thread.
class PixelUnpacker {
 public:
  /// Throws Error(Device) that names `camera` for an unsupported format, for pictures of size zero
  /// or an excessive size (a side above 16384, more than 2^26 pixels), and for rows that overlap or
  /// are implausibly long.
  PixelUnpacker(const RawFormat& format, const std::string& camera)
      : layout_(require_layout(format.fourcc, camera)),
        format_(checked_format(format, layout_, camera)),
        bytes_needed_(
            picture_bytes(layout_, format_.width, format_.height, format_.bytes_per_line)),
        curve_(format_.coding.xfer_func),
        matrix_(ycbcr_matrix(format_.coding)) {
    const CodeScale scale = scale_of(format_, layout_);
    wide_black_ = static_cast<float>(scale.black);
    wide_per_code_ = static_cast<float>(scale.per_code);
    for (size_t code = 0; code < 256; ++code) {
      const auto value = static_cast<double>(code);
      encoded_of_luma_[code] = static_cast<float>((value - scale.black) * scale.per_code);
      const double held = std::clamp((value - scale.black) * scale.per_code, 0.0, 1.0);
      light_of_code_[code] = static_cast<float>(linear_by_formula(format_.coding.xfer_func, held));
      chroma_of_code_[code] =
          static_cast<float>((value - scale.chroma_middle) * scale.chroma_per_code);
    }
    if (layout_.packing != Packing::Jpeg) return;
    jpeg_.reset(tjInitDecompress());
    if (!jpeg_) throw Error(ErrorKind::Failed, "jpeg decoder: out of memory");
  }

  [[nodiscard]] int channels() const { return layout_.channels(); }
  /// Returns the bytes of a whole picture; 0 for JPEG, whose size varies.
  [[nodiscard]] size_t bytes_needed() const { return bytes_needed_; }
  /// Sets size, channels and light, reusing the memory of `out`. Returns false if the bytes are too
  /// few or damaged; the light of `out` is undefined then.
  [[nodiscard]] bool unpack(std::span<const uint8_t> bytes, CameraPicture& out) {
    if (bytes.size() < bytes_needed_) return false;
    out.width = format_.width;
    out.height = format_.height;
    out.channels = channels();
    out.light.resize(static_cast<size_t>(out.width) * static_cast<size_t>(out.height) *
                     static_cast<size_t>(out.channels));
    switch (layout_.packing) {
      case Packing::Grey8:
        unpack_grey8(bytes, out.light);
        return true;
      case Packing::Grey16:
        unpack_grey16(bytes, out.light);
        return true;
      case Packing::Bayer8:
        unpack_bayer(bytes, out.light);
        return true;
      case Packing::Yuv422:
      case Packing::Nv12:
      case Packing::Rgb:
        unpack_colours(bytes, out.light);
        return true;
      case Packing::Jpeg:
        break;
    }
    return unpack_jpeg(bytes, out.light);
  }

 private:
  /// Returns true for a harmless warning. The library keeps its first warning; if that warning is
  /// about bytes before the end marker, the picture was complete.
  static bool is_harmless(tjhandle handle) {
    if (tjGetErrorCode(handle) != TJERR_WARNING) return false;
    return std::string_view(tjGetErrorStr2(handle))
        .ends_with("extraneous bytes before marker 0xd9");
  }

  [[nodiscard]] const uint8_t* row(std::span<const uint8_t> bytes, int y) const {
    return bytes.data() + static_cast<size_t>(y) * format_.bytes_per_line;
  }
  void unpack_grey8(std::span<const uint8_t> bytes, std::span<float> light) const {
    float* out = light.data();
    for (int y = 0; y < format_.height; ++y) {
      const uint8_t* const codes = row(bytes, y);
      for (int x = 0; x < format_.width; ++x) *out++ = light_of_code_[codes[x]];
    }
  }
  void unpack_grey16(std::span<const uint8_t> bytes, std::span<float> light) const {
    float* out = light.data();
    for (int y = 0; y < format_.height; ++y) {
      const uint8_t* codes = row(bytes, y);
      for (int x = 0; x < format_.width; ++x, codes += 2) {
        const auto code = static_cast<float>(codes[0] | codes[1] << 8);
        *out++ = curve_((code - wide_black_) * wide_per_code_);
      }
    }
  }
  /// Interpolates a sensor's mosaic of filters bilinearly: a colour without a filter on a pixel is
  /// the mean of its nearest neighbours with that filter. Both sides are at least 2.
  void unpack_bayer(std::span<const uint8_t> bytes, std::span<float> light) {
    mosaic_.resize(static_cast<size_t>(format_.width) * static_cast<size_t>(format_.height));
    unpack_grey8(bytes, mosaic_);
    const int width = format_.width, height = format_.height;
    // The mirrored neighbour beyond an edge has the filter of the missing one.
    const auto mirrored = [](int index, int count) {
      if (index < 0) return 1;
      return index < count ? index : count - 2;
    };
    const auto row_of = [&](int y) {
      return &mosaic_[static_cast<size_t>(mirrored(y, height)) * static_cast<size_t>(width)];
    };
    float* rgb = light.data();
    for (int y = 0; y < height; ++y) {
      const float *const above = row_of(y - 1), *const here = row_of(y),
                         *const below = row_of(y + 1);
      const bool red_row = (y & 1) == layout_.red_row;
      for (int x = 0; x < width; ++x, rgb += 3) {
        const int left = mirrored(x - 1, width), right = mirrored(x + 1, width);
        const float beside = 0.5F * (here[left] + here[right]);
        const float upright = 0.5F * (above[x] + below[x]);
        const float corners = 0.25F * (above[left] + above[right] + below[left] + below[right]);
        const bool green = ((x & 1) == layout_.red_column) != red_row;
        // One of red and blue has its filters in this row.
        const float of_row = green ? beside : here[x];
        const float other = green ? upright : corners;
        rgb[0] = red_row ? of_row : other;
        rgb[1] = green ? here[x] : 0.5F * (beside + upright);
        rgb[2] = red_row ? other : of_row;
      }
    }
  }
  void unpack_colours(std::span<const uint8_t> bytes, std::span<float> light) const {
    float* out = light.data();
    const bool ycbcr = layout_.samples() == Samples::Ycbcr;
    for (int y = 0; y < format_.height; ++y)
      each_pixel(layout_, format_, bytes, y, [&](uint8_t first, uint8_t second, uint8_t third) {
        if (ycbcr) {
          set_ycbcr(first, second, third, out);
          out += 3;
        } else {
          for (const uint8_t code : {first, second, third}) *out++ = light_of_code_[code];
        }
      });
  }
  /// Accepts a picture of exactly this size, also with extra bytes between picture and end marker,
  /// which many cameras send.
  [[nodiscard]] bool unpack_jpeg(std::span<const uint8_t> bytes, std::span<float> light) {
    int width = 0, height = 0, subsampling = 0, colorspace = 0;
    if (bytes.empty() || tjDecompressHeader3(jpeg_.get(), bytes.data(), bytes.size(), &width,
                                             &height, &subsampling, &colorspace) != 0)
      return false;
    const bool has_rgb =
        colorspace == TJCS_YCbCr || colorspace == TJCS_GRAY || colorspace == TJCS_RGB;
    if (width != format_.width || height != format_.height || !has_rgb) return false;
    rgb_.resize(light.size());
    const int failed = tjDecompress2(jpeg_.get(), bytes.data(), bytes.size(), rgb_.data(), width, 0,
                                     height, TJPF_RGB, TJFLAG_LIMITSCANS | TJFLAG_ACCURATEDCT);
    if (failed != 0 && !is_harmless(jpeg_.get())) return false;
    std::ranges::transform(rgb_, light.begin(),
                           [this](uint8_t code) { return light_of_code_[code]; });
    return true;
  }
  void set_ycbcr(uint8_t luma, uint8_t cb, uint8_t cr, float* rgb) const {
    const float y = encoded_of_luma_[luma];
    const float blue = chroma_of_code_[cb];
    const float red = chroma_of_code_[cr];
    rgb[0] = curve_(y + static_cast<float>(matrix_.red_cr) * red);
    rgb[1] = curve_(y + static_cast<float>(matrix_.green_cb) * blue +
                    static_cast<float>(matrix_.green_cr) * red);
    rgb[2] = curve_(y + static_cast<float>(matrix_.blue_cb) * blue);
  }

  PixelLayout layout_;
  RawFormat format_;
  size_t bytes_needed_ = 0;
  TransferCurve curve_;
  std::array<float, 256> light_of_code_{};    // 8-bit luma or R'G'B'
  std::array<float, 256> encoded_of_luma_{};  // black 0, white 1
  std::array<float, 256> chroma_of_code_{};   // -1/2 to 1/2
  float wide_black_ = 0.0F;                   // scale of samples of more than 8 bits
  float wide_per_code_ = 1.0F;
  YcbcrMatrix matrix_;
  struct CloseJpeg {
    void operator()(void* handle) const noexcept { (void)tjDestroy(handle); }
  };
  std::vector<float> mosaic_;
  std::unique_ptr<void, CloseJpeg> jpeg_;  ///< handle of libjpeg-turbo, for JPEG alone
  std::vector<uint8_t> rgb_;
};

}  // namespace lenticule::calib
