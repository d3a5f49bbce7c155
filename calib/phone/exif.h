// SPDX-License-Identifier: Apache-2.0
// Reads the focal length that a camera states in a JPEG file (EXIF 2.3).
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>

#include "calib/calibration.h"

namespace lenticule::calib {

/// Returns FocalLengthIn35mmFilm, in millimetres, from the bytes of a JPEG file; nothing if there
/// is none, also for damaged or other files.
[[nodiscard]] std::optional<double> stated_focal_35mm(std::span<const uint8_t> jpeg);

/// Reads the file's first bytes, where EXIF is. Returns nothing also if the file cannot be read.
[[nodiscard]] std::optional<double> stated_focal_35mm(const std::filesystem::path& file);

/// Returns a stated focal length in pixels. EXIF states whole millimetres, which phones round
/// generously: the standard error is 3 %.
[[nodiscard]] Estimate focal_of_film(double focal_35mm, int longer_side_px);

}  // namespace lenticule::calib
