// SPDX-License-Identifier: Apache-2.0
// Which picture format some bytes are, and whether they reach to the format's end mark. Decoders
// are lenient about a file that stops early; a player must not be.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace lenticule::frames {

enum class ImageFormat { Unknown, Png, Jpeg, Tiff, Exr, Pnm, Bmp, Targa, Hdr };

/// By the first bytes. Targa has no mark of its own and is taken from the name's extension.
[[nodiscard]] ImageFormat detect_format(std::span<const uint8_t> bytes, std::string_view name);

/// By the extension, of files to be written; case does not matter.
[[nodiscard]] ImageFormat format_of_extension(std::string_view extension);

/// What OpenImageIO calls it; empty for Unknown.
[[nodiscard]] const char* plugin_name(ImageFormat format);

/// False if a PNG or JPEG ends before its end mark. Other formats state where their pixels lie, so
/// that their decoders notice by themselves: always true for them.
[[nodiscard]] bool reaches_end_mark(ImageFormat format, std::span<const uint8_t> bytes);

/// False if an EXR's header states attributes longer than the file. Its decoder would allocate
/// them. Always true for other formats.
[[nodiscard]] bool header_fits(ImageFormat format, std::span<const uint8_t> bytes);

}  // namespace lenticule::frames
