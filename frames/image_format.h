// SPDX-License-Identifier: Apache-2.0
// Detects the format of a picture file and checks that the file is complete. Decoders accept
// truncated files; a player must not.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace lenticule::frames {

enum class ImageFormat { Unknown, Png, Jpeg, Tiff, Exr, Pnm, Bmp, Targa, Hdr, WebP, Heif, Gif };

/// Detects the format from the first bytes. Targa has no signature and is detected by the extension
/// of `name`. A GIF of several pictures is a film, and Unknown here.
[[nodiscard]] ImageFormat detect_format(std::span<const uint8_t> bytes, std::string_view name);

/// Returns the format for the extension of a file to be written; case does not matter.
[[nodiscard]] ImageFormat format_of_extension(std::string_view extension);

/// Returns OpenImageIO's name of the format; empty for Unknown.
[[nodiscard]] const char* plugin_name(ImageFormat format);

/// Returns false if a PNG, JPEG or WebP ends before its end mark. Other formats state the offsets
/// of their pixels, so their decoders detect truncation: the result is always true for them.
[[nodiscard]] bool reaches_end_mark(ImageFormat format, std::span<const uint8_t> bytes);

/// Returns false if an EXR's header states attributes longer than the file, for which its decoder
/// would allocate memory. Always true for other formats.
[[nodiscard]] bool header_fits(ImageFormat format, std::span<const uint8_t> bytes);

// Checks a picture's header before memory is allocated for its pixels.

/// Throws Error(Input), beginning with `name`, if a side or the number of pixels is out of range.
void check_picture_size(const std::string& name, uint64_t width, uint64_t height,
                        uint64_t max_pixels);

/// Returns the aspect of a pixel that a header states as width by height; 1 if it is implausible.
[[nodiscard]] double plausible_pixel_aspect(double aspect);

}  // namespace lenticule::frames
