// SPDX-License-Identifier: Apache-2.0
// Reads HEIF, which phones write as .heic, and AVIF with libheif. OpenImageIO's own reader takes
// files by their names only, and knows no pairs of pictures.
#pragma once

#include <OpenImageIO/imageio.h>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

namespace lenticule::frames::pictures {

/// Loads the codecs that libheif has as plug-ins, which a confined process could not open.
void prepare_heif();

/// Returns the item numbers of the pictures for the left and the right eye: those of the first
/// group of the kind `ster` (ISO/IEC 23008-12, 6.8.5), as phones and headsets write it. Returns
/// nothing for damaged boxes.
[[nodiscard]] std::optional<std::array<uint32_t, 2>> eyes_in_heif(std::span<const uint8_t> file);

/// Subimages of the reader; the last two exist if the file has two eyes' pictures.
enum HeifPicture { kHeifPrimary, kHeifLeft, kHeifRight };

/// Returns a reader of the file, to be opened. Pictures are upright and have 8 bits.
///
/// Lifetime: the bytes must outlive the reader.
[[nodiscard]] std::unique_ptr<OIIO::ImageInput> heif_reader(std::span<const uint8_t> file);

}  // namespace lenticule::frames::pictures
