// SPDX-License-Identifier: Apache-2.0
#include "frames/picture_codec.h"

#include <dlfcn.h>
#include <fmt/format.h>
#include <spng.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <utility>

#include "base/error_kinds.h"
#include "base/owned.h"
#include "frames/exif_tags.h"
#include "frames/srgb.h"

namespace lenticule::frames {
namespace {

using Context = Owned<spng_ctx, spng_ctx_free>;

Context new_context(int flags) {
  Context context(spng_ctx_new(flags));
  if (!context) throw std::bad_alloc();
  return context;
}

/// PngReader reads one picture.
///
/// Lifetime: the bytes must outlive the reader.
class PngReader {
 public:
  /// Checks the header. Throws Error(Input).
  PngReader(std::span<const uint8_t> bytes, std::string name)
      : name_(std::move(name)), context_(new_context(0)) {
    if (!reaches_end_mark(ImageFormat::Png, bytes)) fail("truncated");
    // Chunks beside the pixels: a colour profile or a comment of more is not needed for a picture.
    constexpr size_t kMostOfChunk = size_t{16} << 20, kMostOfChunks = size_t{64} << 20;
    require(spng_set_chunk_limits(context_.get(), kMostOfChunk, kMostOfChunks));
    require(spng_set_png_buffer(context_.get(), bytes.data(), bytes.size()));
    require(spng_get_ihdr(context_.get(), &header_));
    check_picture_size(name_, header_.width, header_.height, kMaxImagePixels);
    // Deflate shrinks at most 1032-fold: fewer bytes cannot hold the picture.
    constexpr uint64_t kMaxDeflateRatio = 1032;
    const uint64_t pixels = uint64_t{header_.width} * uint64_t{header_.height};
    if (bytes.size() * kMaxDeflateRatio < pixels / 8) fail("truncated");
  }

  [[nodiscard]] int width() const { return static_cast<int>(header_.width); }
  [[nodiscard]] int height() const { return static_cast<int>(header_.height); }
  [[nodiscard]] bool has_16_bits() const { return header_.bit_depth == 16; }

  /// Reads the chunks before the pixels.
  [[nodiscard]] PictureInfo info() {
    return {.geometry = {.width = width(), .height = height()},
            .orientation = orientation(),
            .pixel_aspect = pixel_aspect()};
  }

  /// Decodes all rows in the format `fmt` of the library. `row_at(y)` returns the memory of row y,
  /// `row_bytes` long, and is called in order.
  template <class RowAt>
  void decode(int fmt, size_t row_bytes, RowAt&& row_at) {
    if (header_.interlace_method == SPNG_INTERLACE_NONE)
      decode_in_order(fmt, row_bytes, row_at);
    else
      decode_interlaced(fmt, row_bytes, row_at);
    // Reads on to the end, which checks the last checksum of the pixels.
    require(spng_decode_chunks(context_.get()));
  }

 private:
  template <class RowAt>
  void decode_in_order(int fmt, size_t row_bytes, RowAt&& row_at) {
    require(spng_decode_image(context_.get(), nullptr, 0, fmt,
                              SPNG_DECODE_TRNS | SPNG_DECODE_PROGRESSIVE));
    for (int y = 0; y < height(); ++y) {
      const int result = spng_decode_row(context_.get(), row_at(y), row_bytes);
      if (result != SPNG_EOI || y + 1 != height()) require(result);
    }
  }

  /// Memory that no row was decoded into yet is only reserved.
  template <class RowAt>
  void decode_interlaced(int fmt, size_t row_bytes, RowAt&& row_at) {
    const size_t size = row_bytes * header_.height;
    const auto rows = std::make_unique_for_overwrite<uint8_t[]>(size);
    require(spng_decode_image(context_.get(), rows.get(), size, fmt, SPNG_DECODE_TRNS));
    for (int y = 0; y < height(); ++y)
      std::copy_n(rows.get() + static_cast<size_t>(y) * row_bytes, row_bytes, row_at(y));
  }

  /// Returns the orientation; Upright if the tag is missing or invalid.
  [[nodiscard]] Orientation orientation() {
    spng_exif exif{};
    if (!has(spng_get_exif(context_.get(), &exif))) return Orientation::Upright;
    return ExifTags({reinterpret_cast<const uint8_t*>(exif.data), exif.length}).orientation();
  }

  [[nodiscard]] double pixel_aspect() {
    spng_phys density{};
    if (!has(spng_get_phys(context_.get(), &density)) || density.ppu_x == 0) return 1.0;
    return plausible_pixel_aspect(static_cast<double>(density.ppu_y) / density.ppu_x);
  }

  /// Returns false if the picture does not have the chunk.
  [[nodiscard]] bool has(int result) const {
    if (result == SPNG_ECHUNKAVAIL) return false;
    require(result);
    return true;
  }

  void require(int result) const {
    if (result == SPNG_EMEM) throw std::bad_alloc();
    if (result != SPNG_OK) fail(std::string("truncated or damaged: ") + spng_strerror(result));
  }

  [[noreturn]] void fail(const std::string& cause) const {
    throw input_error("{}: {}", name_, cause);
  }

  std::string name_;
  Context context_;
  spng_ihdr header_{};
};

/// Every format of 16 bits is decoded to four channels.
constexpr size_t kWideChannels = 4;

class PngCodec final : public PictureCodec {
 public:
  [[nodiscard]] PictureInfo probe(std::span<const uint8_t> bytes,
                                  const std::string& name) const override {
    return PngReader(bytes, name).info();
  }

  void decode(std::span<const uint8_t> bytes, const std::string& name, PictureValues values,
              PictureSink& sink) const override {
    const bool codes = values == PictureValues::Codes;
    PngReader reader(bytes, name);
    PictureInfo info = reader.info();
    if (!codes) info.pixel_bytes = reader.has_16_bits() ? 4 * sizeof(float) : 4;
    RowsOfSink out(sink, info);
    if (!reader.has_16_bits())
      return reader.decode(codes ? SPNG_FMT_RGB8 : SPNG_FMT_RGBA8, out.row_bytes(),
                           [&](int y) { return out.row(y); });
    decode_wide(reader, [&](int y, std::span<const uint16_t> rgba) {
      uint8_t* const row = out.row(y);
      if (codes) return codes_of(rgba, row);
      auto* texel = reinterpret_cast<float*>(row);
      for (size_t at = 0; at < rgba.size(); ++at)
        *texel++ = values == PictureValues::Colours && at % 4 != 3 ? linear_from_16_bits(rgba[at])
                                                                   : fraction_of_16_bits(rgba[at]);
    });
  }

  [[nodiscard]] std::vector<uint8_t> encode(const FrameView& frame, ImageFormat format,
                                            const std::string& name) const override {
    LENTICULE_CHECK(format == ImageFormat::Png);
    // Frames of a sequence are written more often than they are stored. In a woven frame the
    // neighbours to the left belong to other views; the row above is the same picture shifted by
    // the slant. On a 4K frame this combination is the fastest and gives the smallest file of the
    // fast ones (docs/content/frames.md).
    constexpr int kLevel = 1;
    const Context context = new_context(SPNG_CTX_ENCODER);
    const auto require = [&](int result) {
      if (result == SPNG_EMEM) throw std::bad_alloc();
      if (result != SPNG_OK)
        throw failed_error("{}: cannot encode: {}", name, spng_strerror(result));
    };
    spng_ihdr header{.width = static_cast<uint32_t>(frame.geometry.width),
                     .height = static_cast<uint32_t>(frame.geometry.height),
                     .bit_depth = 8,
                     .color_type = SPNG_COLOR_TYPE_TRUECOLOR,
                     .compression_method = 0,
                     .filter_method = 0,
                     .interlace_method = SPNG_INTERLACE_NONE};
    require(spng_set_option(context.get(), SPNG_ENCODE_TO_BUFFER, 1));
    require(spng_set_option(context.get(), SPNG_IMG_COMPRESSION_LEVEL, kLevel));
    require(spng_set_option(context.get(), SPNG_FILTER_CHOICE, SPNG_FILTER_CHOICE_UP));
    require(spng_set_ihdr(context.get(), &header));
    require(spng_encode_image(context.get(), frame.bytes.data(), frame.bytes.size(), SPNG_FMT_PNG,
                              SPNG_ENCODE_FINALIZE));
    size_t size = 0;
    int result = SPNG_OK;
    const std::unique_ptr<void, decltype(&std::free)> encoded(
        spng_get_png_buffer(context.get(), &size, &result), &std::free);
    require(result);
    const auto* const bytes = static_cast<const uint8_t*>(encoded.get());
    return {bytes, bytes + size};
  }

 private:
  static void codes_of(std::span<const uint16_t> rgba, uint8_t* rgb) {
    for (size_t at = 0; at < rgba.size(); at += kWideChannels)
      for (size_t c = 0; c < 3; ++c) *rgb++ = code_from_16_bits(rgba[at + c]);
  }

  /// Calls take_row(y, samples) for each row, in order.
  template <class TakeRow>
  static void decode_wide(PngReader& reader, TakeRow&& take_row) {
    std::vector<uint16_t> row(static_cast<size_t>(reader.width()) * kWideChannels);
    int complete = -1;
    const auto next = [&](int y) {
      if (y > 0) take_row(++complete, std::span<const uint16_t>(row));
      return reinterpret_cast<uint8_t*>(row.data());
    };
    reader.decode(SPNG_FMT_RGBA16, row.size() * sizeof(uint16_t), next);
    take_row(++complete, std::span<const uint16_t>(row));
  }
};

/// A name without a folder is searched along this program's run path and the system's library
/// folders, like any library that the program is linked with.
constexpr const char* kModule = LENTICULE_PICTURES_MODULE;

[[noreturn]] void fail(const std::string& cause) {
  throw Error(
      ErrorKind::Failed, fmt::format("{}: cannot be used: {}", kModule, cause),
      "install the package lenticule-media of the same version, which reads pictures, or use PNG");
}

std::string loader_message() {
  const char* message = dlerror();
  return message != nullptr ? message : "no reason given";
}

const PictureCodec& load() {
  // RTLD_LOCAL: no symbol of OpenImageIO may replace a symbol of this program.
  void* module = dlopen(kModule, RTLD_NOW | RTLD_LOCAL);
  if (module == nullptr) fail(loader_message());
  const auto entry = reinterpret_cast<PictureCodecEntry>(dlsym(module, kPictureCodecEntry));
  if (entry == nullptr) fail(loader_message());
  const PictureCodec* codec = entry(LENTICULE_VERSION);
  if (codec == nullptr) fail("it is of another version");
  return *codec;
}

}  // namespace

const PictureCodec& png_codec() {
  static const PngCodec codec;
  return codec;
}

const PictureCodec& picture_codec(ImageFormat format) {
  if (format == ImageFormat::Png) return png_codec();
  static const PictureCodec& codec = load();
  return codec;
}

const PictureDecoder* built_in_codec(std::span<const uint8_t> bytes, const std::string& name) {
  const ImageFormat format = detect_format(bytes, {});
  if (format == ImageFormat::Png) return &png_codec();
  return format == ImageFormat::Jpeg ? jpeg_codec(bytes, name) : nullptr;
}

const PictureDecoder& picture_codec(std::span<const uint8_t> bytes, const std::string& name) {
  const PictureDecoder* const built_in = built_in_codec(bytes, name);
  return built_in != nullptr ? *built_in : picture_codec(ImageFormat::Unknown);
}

}  // namespace lenticule::frames
