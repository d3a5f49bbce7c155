// SPDX-License-Identifier: Apache-2.0
// The decoding half of PictureCodec; contracts there.
#pragma once

#include "frames/picture_codec.h"

namespace lenticule::frames::pictures {

[[nodiscard]] FrameGeometry probe(std::span<const uint8_t> bytes, const std::string& name);
void decode_codes(std::span<const uint8_t> bytes, const std::string& name,
                  const PictureCodec::Prepare& prepare);
[[nodiscard]] FloatImage decode_light(std::span<const uint8_t> bytes, const std::string& name);

}  // namespace lenticule::frames::pictures
