// SPDX-License-Identifier: Apache-2.0
// Reads the focal length that a camera states in a JPEG file (EXIF 2.3).
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <vector>

#include "calib/calibration.h"
#include "frames/exif_tags.h"

namespace lenticule::calib {

/// Returns FocalLengthIn35mmFilm, in millimetres, from the bytes of a JPEG file; nothing if there
/// is none, also for damaged or other files.
[[nodiscard]] inline std::optional<double> stated_focal_35mm(std::span<const uint8_t> jpeg) {
  constexpr uint32_t kExifDirectory = 0x8769, kFocalIn35mm = 0xa405;
  const frames::ExifTags tags(frames::exif_of_jpeg(jpeg));
  const auto directory = tags.value(tags.first_directory(), kExifDirectory);
  if (!directory) return std::nullopt;
  const auto focal = tags.value(*directory, kFocalIn35mm);
  // 0 means unknown.
  if (!focal || *focal == 0 || *focal > 10000) return std::nullopt;
  return static_cast<double>(*focal);
}

/// Reads the file's first bytes, where EXIF is. Returns nothing also if the file cannot be read.
[[nodiscard]] inline std::optional<double> stated_focal_35mm(const std::filesystem::path& file) {
  constexpr size_t kFirst = size_t{1} << 18;  // EXIF is at most 64 KiB, near the start
  std::ifstream in(file, std::ios::binary);
  std::vector<char> text(kFirst);
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  const std::vector<uint8_t> bytes(text.begin(), text.begin() + in.gcount());
  return stated_focal_35mm(std::span<const uint8_t>(bytes));
}

/// Returns a stated focal length in pixels. EXIF states whole millimetres, which phones round
/// generously: the standard error is 3 %.
[[nodiscard]] inline Estimate focal_of_film(double focal_35mm, int longer_side_px) {
  constexpr double kFilmMm = 36.0, kSigma = 0.03;
  const double focal = focal_35mm / kFilmMm * longer_side_px;
  return {focal, kSigma * focal};
}

}  // namespace lenticule::calib
