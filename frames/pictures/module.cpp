// SPDX-License-Identifier: Apache-2.0
// Exports the one function of the lazily loaded library.
#include <string_view>

#include "frames/pictures/decode.h"
#include "frames/pictures/encode.h"

namespace lenticule::frames::pictures {
namespace {

class OiioCodec final : public PictureCodec {
 public:
  PictureInfo probe(std::span<const uint8_t> bytes, const std::string& name) const override {
    return pictures::probe(bytes, name);
  }
  void decode_codes(std::span<const uint8_t> bytes, const std::string& name,
                    PictureSink& sink) const override {
    pictures::decode_codes(bytes, name, sink);
  }
  TextureImage decode_texture(std::span<const uint8_t> bytes, const std::string& name,
                              TextureContent content) const override {
    return pictures::decode_texture(bytes, name, content);
  }
  std::vector<uint8_t> encode(const FrameView& frame, ImageFormat format,
                              const std::string& name) const override {
    return pictures::encode(frame, format, name);
  }
};

}  // namespace
}  // namespace lenticule::frames::pictures

extern "C" [[gnu::visibility("default")]] const lenticule::frames::PictureCodec*
lenticule_picture_codec(const char* version) noexcept {
  static const lenticule::frames::pictures::OiioCodec codec;
  return version == std::string_view(LENTICULE_VERSION) ? &codec : nullptr;
}
