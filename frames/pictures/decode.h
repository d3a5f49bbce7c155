// SPDX-License-Identifier: Apache-2.0
// The decoding half of PictureCodec, which documents the functions.
#pragma once

#include "frames/picture_codec.h"

namespace lenticule::frames::pictures {

[[nodiscard]] PictureInfo probe(std::span<const uint8_t> bytes, const std::string& name);
void decode_codes(std::span<const uint8_t> bytes, const std::string& name, PictureSink& sink);
[[nodiscard]] TextureImage decode_texture(std::span<const uint8_t> bytes, const std::string& name,
                                          TextureContent content);

}  // namespace lenticule::frames::pictures
