// SPDX-License-Identifier: Apache-2.0
// CodeConverter converts a camera's picture to the 8-bit R'G'B' codes that a panel shows: the
// driver's colour coding decides matrix and range. Primaries and transfer function stay as they
// are, as for videos. JPEG, which other machines made, is decoded by the reader of pictures in use:
// in a confined process.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "base/error.h"
#include "base/parallel_rows.h"
#include "frames/capture/pixel_layout.h"
#include "frames/picture_codec.h"

namespace lenticule::frames::capture {

/// CodeWindow is a part of a larger picture that receives the codes.
struct CodeWindow {
  uint8_t* pixels = nullptr;
  size_t stride = 0;
  [[nodiscard]] uint8_t* row(int y) const { return pixels + static_cast<size_t>(y) * stride; }
};

/// CodeConverter supports YUYV, UYVY, NV12, RGB3, BGR3, MJPG, JPEG and GREY.
///
/// Thread safety: one thread.
class CodeConverter {
 public:
  /// Throws Error(Device) that names `camera` for other formats and for sizes that checked_format()
  /// refuses.
  CodeConverter(const RawFormat& format, std::string camera)
      : camera_(std::move(camera)),
        layout_(require_layout(format.fourcc, camera_)),
        format_(checked_format(format, layout_, camera_)),
        bytes_needed_(
            picture_bytes(layout_, format_.width, format_.height, format_.bytes_per_line)) {
    if (layout_.packing == Packing::Bayer8 || layout_.packing == Packing::Grey16)
      refuse_format(camera_, "pictures of " + fourcc_name(format.fourcc) + " cannot be shown");
    const CodeScale scale = scale_of(format_, layout_);
    const YcbcrMatrix matrix = ycbcr_matrix(format_.coding);
    const auto fixed = [](double codes) {
      return static_cast<int32_t>(std::lround(codes * 255.0 * (1 << kPlaces)));
    };
    for (int code = 0; code < 256; ++code) {
      const double luma = (code - scale.black) * scale.per_code;
      const double chroma = (code - scale.chroma_middle) * scale.chroma_per_code;
      const auto at = static_cast<size_t>(code);
      luma_[at] = fixed(luma) + (1 << (kPlaces - 1));  // rounds
      red_cr_[at] = fixed(matrix.red_cr * chroma);
      green_cb_[at] = fixed(matrix.green_cb * chroma);
      green_cr_[at] = fixed(matrix.green_cr * chroma);
      blue_cb_[at] = fixed(matrix.blue_cb * chroma);
      code_[at] = byte_of(luma_[at]);
    }
  }

  [[nodiscard]] const RawFormat& format() const { return format_; }
  /// Writes the codes of a picture. Returns false if the bytes are too few or damaged; the window
  /// is undefined then. Throws what the reader of pictures throws if it cannot be started.
  [[nodiscard]] bool convert(std::span<const uint8_t> bytes, const CodeWindow& to, int threads) {
    if (bytes.size() < bytes_needed_) return false;
    if (layout_.packing == Packing::Jpeg) return decode(bytes, to);
    for_row_ranges(
        format_.height,
        [this, bytes, &to](int begin, int end) {
          for (int y = begin; y < end; ++y) convert_row(bytes, y, to.row(y));
        },
        threads);
    return true;
  }

 private:
  static constexpr int kPlaces = 20;  // binary places of the sums, which stay below 2^30

  static uint8_t byte_of(int32_t fixed) {
    return static_cast<uint8_t>(std::clamp(fixed >> kPlaces, 0, 255));
  }
  void convert_row(std::span<const uint8_t> bytes, int y, uint8_t* out) const {
    if (layout_.samples() == Samples::Ycbcr)
      return each_pixel(layout_, format_, bytes, y, [&](uint8_t luma, uint8_t cb, uint8_t cr) {
        *out++ = byte_of(luma_[luma] + red_cr_[cr]);
        *out++ = byte_of(luma_[luma] + green_cb_[cb] + green_cr_[cr]);
        *out++ = byte_of(luma_[luma] + blue_cb_[cb]);
      });
    each_pixel(layout_, format_, bytes, y, [&](uint8_t red, uint8_t green, uint8_t blue) {
      *out++ = code_[red];
      *out++ = code_[green];
      *out++ = code_[blue];
    });
  }

  /// Rows passes the rows of a decoded picture of the agreed size to the window.
  struct Rows final : PictureSink {
    Rows(const RawFormat& agreed, const CodeWindow& window) : format(agreed), to(window) {}
    void accept(const PictureInfo& info) override {
      if (info.geometry != FrameGeometry{.width = format.width, .height = format.height})
        throw Error(ErrorKind::Input, "its size is another one");
    }
    std::span<uint8_t> rows(int y, int) override {
      return {to.row(y), static_cast<size_t>(format.width) * 3};
    }
    const RawFormat& format;
    const CodeWindow& to;
  };
  [[nodiscard]] bool decode(std::span<const uint8_t> bytes, const CodeWindow& to) const {
    const bool is_jpeg = bytes.size() > 3 && bytes[0] == 0xFF && bytes[1] == 0xD8;
    if (!is_jpeg) return false;  // a decoder of other formats is not started
    try {
      Rows rows(format_, to);
      read_picture(EncodedPicture(bytes, camera_), rows);
      return true;
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::Input) throw;
      return false;
    }
  }

  std::string camera_;
  PixelLayout layout_;
  RawFormat format_;
  size_t bytes_needed_;
  std::array<int32_t, 256> luma_{}, red_cr_{}, green_cb_{}, green_cr_{}, blue_cb_{};
  std::array<uint8_t, 256> code_{};  ///< codes of luma alone, or of R'G'B'
};

}  // namespace lenticule::frames::capture
