// SPDX-License-Identifier: Apache-2.0
// The encoding half of PictureCodec, which documents the function.
#pragma once

#include "frames/picture_codec.h"

namespace lenticule::frames::pictures {

[[nodiscard]] std::vector<uint8_t> encode(const FrameView& frame, ImageFormat format,
                                          const std::string& name);

}  // namespace lenticule::frames::pictures
