// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <csetjmp>
#include <memory>

// Follows <cstdio>, which it needs.
#include <jpeglib.h>
// Follows jpeglib.h, which it needs.
#include <jerror.h>

#include "base/error_kinds.h"
#include "base/text.h"
#include "frames/exif_tags.h"
#include "frames/picture_codec.h"

namespace lenticule::frames {
namespace {

/// JpegReader reads one picture.
///
/// Lifetime: the bytes must outlive the reader.
class JpegReader {
 public:
  /// Reads the header. Throws Error(Input).
  JpegReader(std::span<const uint8_t> bytes, std::string name)
      : name_(std::move(name)), bytes_(bytes) {
    jpeg_.err = jpeg_std_error(&errors_);
    jpeg_.client_data = this;
    errors_.error_exit = [](j_common_ptr jpeg) { std::longjmp(of(jpeg).failed_, 1); };
    errors_.emit_message = [](j_common_ptr jpeg, int level) {
      // Warnings that the library filled in missing or damaged pixels.
      constexpr std::array kDamage = {JWRN_HIT_MARKER, JWRN_HUFF_BAD_CODE, JWRN_JPEG_EOF,
                                      JWRN_MUST_RESYNC};
      const bool damaged = std::ranges::find(kDamage, jpeg->err->msg_code) != kDamage.end();
      if (level < 0 && damaged) std::longjmp(of(jpeg).failed_, 1);
    };
    run([this] {
      jpeg_create_decompress(&jpeg_);
      jpeg_mem_src(&jpeg_, bytes_.data(), bytes_.size());
      jpeg_read_header(&jpeg_, TRUE);
    });
  }

  /// Returns true for pictures that this reader returns as OpenImageIO does.
  [[nodiscard]] bool is_usual() const {
    const J_COLOR_SPACE space = jpeg_.jpeg_color_space;
    const bool has_colours = space == JCS_GRAYSCALE || space == JCS_YCbCr || space == JCS_RGB;
    // Densities of which one is 1 state the aspect of a pixel. Another .mpo may have two eyes.
    return has_colours && !jpeg_.arith_code && (jpeg_.X_density > 1) == (jpeg_.Y_density > 1) &&
           !lower_case(name_).ends_with(".mpo");
  }

  /// Throws Error(Input) for a picture that is too large, or larger than its bytes can hold.
  [[nodiscard]] PictureInfo checked_info() const {
    check_picture_size(name_, jpeg_.image_width, jpeg_.image_height, kMaxImagePixels);
    constexpr size_t kMostPixelsOfByte = 8 * 64;  // a block of 64 takes at least a bit
    const size_t pixels = size_t{jpeg_.image_width} * jpeg_.image_height;
    if (!reaches_end_mark(ImageFormat::Jpeg, bytes_) || pixels / kMostPixelsOfByte > bytes_.size())
      fail("truncated");
    PictureInfo info{.geometry = {.width = static_cast<int>(jpeg_.image_width),
                                  .height = static_cast<int>(jpeg_.image_height)}};
    double across = jpeg_.X_density, down = jpeg_.Y_density;
    const ExifTags tags(exif_of_jpeg(bytes_));
    info.orientation = tags.orientation();
    if (across <= 1) {
      constexpr uint32_t kAcross = 0x011A, kDown = 0x011B;
      across = tags.ratio(kAcross);
      down = tags.ratio(kDown);
    }
    if (across > 0 && down > 0) info.pixel_aspect = plausible_pixel_aspect(down / across);
    return info;
  }

  void decode(PictureValues values, PictureSink& sink) {
    const bool codes = values == PictureValues::Codes;
    PictureInfo info = checked_info();
    if (!codes) info.pixel_bytes = 4;
    RowsOfSink out(sink, info);
    jpeg_.out_color_space = codes ? JCS_RGB : JCS_EXT_RGBA;
    run([this] { jpeg_start_decompress(&jpeg_); });
    for (int y = 0; y < info.geometry.height; ++y) {
      uint8_t* row = out.row(y);
      run([&] { jpeg_read_scanlines(&jpeg_, &row, 1); });
    }
  }

 private:
  static JpegReader& of(j_common_ptr jpeg) { return *static_cast<JpegReader*>(jpeg->client_data); }

  /// Calls functions of the library, from which an error jumps back: `call` may have no objects
  /// with destructors.
  template <class Call>
  void run(Call&& call) {
    if (setjmp(failed_) == 0) return call();
    if (errors_.msg_code == JERR_OUT_OF_MEMORY) throw std::bad_alloc();
    std::array<char, JMSG_LENGTH_MAX> message{};
    errors_.format_message(reinterpret_cast<j_common_ptr>(&jpeg_), message.data());
    fail(fmt::format("truncated or damaged: JPEG error: {}", message.data()));
  }

  [[noreturn]] void fail(const std::string& cause) const {
    throw input_error("{}: {}", name_, cause).remedy(kPictureRemedy);
  }

  std::string name_;
  std::span<const uint8_t> bytes_;
  jpeg_error_mgr errors_{};
  std::jmp_buf failed_{};
  jpeg_decompress_struct jpeg_{};
  std::unique_ptr<jpeg_decompress_struct, decltype(&jpeg_destroy_decompress)> destroyed_{
      &jpeg_, &jpeg_destroy_decompress};
};

class JpegCodec final : public PictureDecoder {
 public:
  [[nodiscard]] PictureInfo probe(std::span<const uint8_t> bytes,
                                  const std::string& name) const override {
    return JpegReader(bytes, name).checked_info();
  }

  void decode(std::span<const uint8_t> bytes, const std::string& name, PictureValues values,
              PictureSink& sink) const override {
    JpegReader(bytes, name).decode(values, sink);
  }
};

}  // namespace

const PictureDecoder* jpeg_codec(std::span<const uint8_t> bytes, const std::string& name) {
  static const JpegCodec codec;
  try {
    return JpegReader(bytes, name).is_usual() ? &codec : nullptr;
  } catch (const Error&) {
    return nullptr;
  }
}

}  // namespace lenticule::frames
