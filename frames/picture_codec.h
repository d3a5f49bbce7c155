// SPDX-License-Identifier: Apache-2.0
// Decoding and encoding of pictures, kept in a module of its own (frames/pictures) that is loaded
// when the first picture is read or written: OpenImageIO and what it drags in take longer to load
// than a player takes to show its first frame, and a player fed from a ring needs none of it.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "frames/frame.h"
#include "frames/image_format.h"
#include "frames/image_io.h"

namespace lenticule::frames {

/// The interface between the program and the module; both are of one build. Every function is safe
/// from any thread and throws Error as its caller in image_io.h says. `name` is for messages.
class PictureCodec {
 public:
  virtual ~PictureCodec() = default;

  [[nodiscard]] virtual FrameGeometry probe(std::span<const uint8_t> bytes,
                                            const std::string& name) const = 0;
  /// `prepare` is called once, after the first rows are decoded, and returns the frame of that
  /// geometry to fill; it may throw.
  using Prepare = std::function<WovenFrame&(const FrameGeometry&)>;
  virtual void decode_codes(std::span<const uint8_t> bytes, const std::string& name,
                            const Prepare& prepare) const = 0;
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

}  // namespace lenticule::frames
