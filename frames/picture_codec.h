// SPDX-License-Identifier: Apache-2.0
// Decoding and encoding of pictures, kept in a module of its own (frames/pictures) that is loaded
// when the first picture is read or written: OpenImageIO and what it drags in take longer to load
// than a player takes to show its first frame, and a player fed from a ring needs none of it.
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

/// Receives the code values of one picture, in one thread.
class PictureSink {
 public:
  virtual ~PictureSink() = default;
  /// Called once, with what the header says, before anything is decoded; throws to refuse it.
  virtual void accept(const PictureInfo& info) = 0;
  /// Returns the memory for packed RGB rows from row `y` on: for one row at least, and for `rows`
  /// of them at most. The rows of the call before are complete by then. May throw.
  [[nodiscard]] virtual std::span<uint8_t> rows(int y, int rows) = 0;
};

/// The interface between the program and the module; both are of one build. Every function is safe
/// from any thread and throws Error as its caller in image_io.h says. `name` is for messages.
class PictureCodec {
 public:
  virtual ~PictureCodec() = default;

  [[nodiscard]] virtual PictureInfo probe(std::span<const uint8_t> bytes,
                                          const std::string& name) const = 0;
  virtual void decode_codes(std::span<const uint8_t> bytes, const std::string& name,
                            PictureSink& sink) const = 0;
  [[nodiscard]] virtual FloatImage decode_light(std::span<const uint8_t> bytes,
                                                const std::string& name) const = 0;
  [[nodiscard]] virtual std::vector<uint8_t> encode(const FrameView& frame, ImageFormat format,
                                                    const std::string& name) const = 0;
};

/// The module's codec, loaded on the first call and never unloaded. Safe from any thread. Throws
/// Error(Failed) naming the module and what the loader said.
[[nodiscard]] const PictureCodec& picture_codec();

/// What the module exports: a function of this type under this name, returning null for a `version`
/// that is not its own.
using PictureCodecEntry = const PictureCodec* (*)(const char* version) noexcept;
inline constexpr const char* kPictureCodecEntry = "lenticule_picture_codec";

/// Reads the code values of picture files. Every function is safe from any thread and throws as
/// probe_picture() and read_woven() do.
class PictureFileReader {
 public:
  virtual ~PictureFileReader() = default;
  [[nodiscard]] virtual PictureInfo probe(const std::filesystem::path& file) const = 0;
  virtual void read(const std::filesystem::path& file, PictureSink& sink) const = 0;
};

/// Makes image_io.h read code values through `reader`, which must live until the process ends or
/// null is set. Null: this process decodes them itself.
void use_picture_reader(const PictureFileReader* reader) noexcept;

}  // namespace lenticule::frames
