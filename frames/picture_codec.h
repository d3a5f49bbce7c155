// SPDX-License-Identifier: Apache-2.0
// PictureCodec decodes and encodes pictures. PNG and the decoding of most JPEGs are part of the
// program. Other formats are in a library (frames/pictures) that is loaded when the first such
// picture is read or written: loading OpenImageIO and its dependencies takes longer than a player
// takes to show its first frame.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "frames/frame.h"
#include "frames/image_format.h"
#include "frames/image_io.h"

namespace lenticule::frames {

/// Remedy for files that cannot be decoded as pictures.
inline constexpr const char* kPictureRemedy =
    "save it again as PNG; the names of films end in .lts, .mkv, .mp4 or the like";
/// Remedy for pictures and films that turn out to be damaged while they are read.
inline constexpr const char* kDamagedRemedy = "copy it anew, or save it again with another program";

/// PictureValues says which values of a picture are wanted.
enum class PictureValues : uint32_t {
  Codes,    ///< RGB code values, as read_woven() returns them
  Colours,  ///< RGBA of a colour texture, as TextureImage has them: four bytes or four floats
  Data,     ///< RGBA of another texture
};

/// PictureSink receives the pixels of one picture, in one thread.
class PictureSink {
 public:
  virtual ~PictureSink() = default;
  /// Called once with the header's properties, before the pixels are decoded; throws to refuse the
  /// picture.
  virtual void accept(const PictureInfo& info) = 0;
  /// Returns the memory for packed rows from row `y` on: for at least one row and at most `rows`
  /// rows. The rows of the previous call are complete by then. May throw.
  [[nodiscard]] virtual std::span<uint8_t> rows(int y, int rows) = 0;
};

/// Every function throws the Error that its caller in image_io.h documents. `name` is for messages.
///
/// Thread safety: any thread.
class PictureDecoder {
 public:
  virtual ~PictureDecoder() = default;

  [[nodiscard]] virtual PictureInfo probe(std::span<const uint8_t> bytes,
                                          const std::string& name) const = 0;
  virtual void decode(std::span<const uint8_t> bytes, const std::string& name, PictureValues values,
                      PictureSink& sink) const = 0;
};

/// PictureCodec is also the interface between the program and the lazily loaded library, which come
/// from the same build.
class PictureCodec : public PictureDecoder {
 public:
  [[nodiscard]] virtual std::vector<uint8_t> encode(const FrameView& frame, ImageFormat format,
                                                    const std::string& name) const = 0;
};

/// RowsOfSink hands out single rows of a sink that returns several at a time.
class RowsOfSink {
 public:
  /// Calls the sink's accept().
  RowsOfSink(PictureSink& sink, const PictureInfo& info)
      : sink_(sink),
        height_(info.geometry.height),
        row_bytes_(static_cast<size_t>(info.geometry.width) * info.pixel_bytes) {
    sink.accept(info);
  }
  uint8_t* row(int y) {
    if (left_.empty()) left_ = sink_.rows(y, height_ - y);
    uint8_t* const row = left_.data();
    left_ = left_.subspan(row_bytes_);
    return row;
  }
  [[nodiscard]] size_t row_bytes() const { return row_bytes_; }

 private:
  PictureSink& sink_;
  int height_;
  size_t row_bytes_;
  std::span<uint8_t> left_;
};

/// Returns the codec that encodes a format, and the one that decodes a picture. Those of all
/// formats but PNG and usual JPEGs are loaded on the first call and never unloaded. Throw
/// Error(Failed) with the library's name and the loader's message.
///
/// Thread safety: any thread.
[[nodiscard]] const PictureCodec& picture_codec(ImageFormat format);
[[nodiscard]] const PictureDecoder& picture_codec(std::span<const uint8_t> bytes,
                                                  const std::string& name);
/// Returns null if only the loaded library decodes the picture.
[[nodiscard]] const PictureDecoder* built_in_codec(std::span<const uint8_t> bytes,
                                                   const std::string& name);

/// Type and name of the function that the library exports. The function returns null for a
/// `version` that is not its own.
using PictureCodecEntry = const PictureCodec* (*)(const char* version) noexcept;
inline constexpr const char* kPictureCodecEntry = "lenticule_picture_codec";

/// EncodedPicture is a picture file, or one in memory, as models embed them.
struct EncodedPicture {
  EncodedPicture(const std::filesystem::path& path) : file(path), name(path.string()) {}
  EncodedPicture(std::span<const uint8_t> encoded, std::string label)
      : bytes(encoded), name(std::move(label)) {}

  std::filesystem::path file;  ///< empty if the picture is in memory
  std::span<const uint8_t> bytes;
  std::string name;  ///< for messages
};

/// PictureFileReader reads pictures. Every function throws the errors of probe_picture(),
/// read_woven() and read_texture().
///
/// Thread safety: any thread.
class PictureFileReader {
 public:
  virtual ~PictureFileReader() = default;
  [[nodiscard]] virtual PictureInfo probe(const std::filesystem::path& file) const = 0;
  virtual void read(const EncodedPicture& picture, PictureSink& sink,
                    PictureValues values = PictureValues::Codes) const = 0;
  /// Reads the Colours or the Data of a texture, by read() unless a reader does it otherwise.
  [[nodiscard]] virtual TextureImage texture(const EncodedPicture& picture, PictureValues values,
                                             TexelPlace place) const;
};

/// Makes image_io.h read pictures through `reader`; with null, this process decodes them itself
/// (the default).
///
/// Lifetime: `reader` must live until the process ends or null is set.
void use_picture_reader(const PictureFileReader* reader) noexcept;
/// Reads the code values of a picture through the reader in use.
void read_picture(const EncodedPicture& picture, PictureSink& sink);

// Codecs with libraries that load in a millisecond. They change no code value: chunks that describe
// colours are ignored.

/// Return the codec of PNG, and the decoder of JPEG: null for unusual ones (CMYK, arithmetic
/// coding, two eyes, a damaged header).
///
/// Thread safety: any thread.
[[nodiscard]] const PictureCodec& png_codec();
[[nodiscard]] const PictureDecoder* jpeg_codec(std::span<const uint8_t> bytes,
                                               const std::string& name);

}  // namespace lenticule::frames
