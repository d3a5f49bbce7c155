// SPDX-License-Identifier: Apache-2.0
// Decodes and encodes PNG, the format of most pictures, with a library that loads in a millisecond:
// OpenImageIO and what it depends on take half a second.
#pragma once

#include "frames/picture_codec.h"

namespace lenticule::frames {

/// Returns the codec. Its functions take PNG only, and change no code value: chunks that describe
/// colours are ignored.
///
/// Thread safety: any thread.
[[nodiscard]] const PictureCodec& png_codec();

}  // namespace lenticule::frames
