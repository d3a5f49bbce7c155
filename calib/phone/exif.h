// SPDX-License-Identifier: Apache-2.0
// Reads the focal length that a camera states in a JPEG file (EXIF 2.3).
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "calib/calibration.h"
#include "frames/exif_tags.h"

namespace lenticule::calib {

inline std::optional<double> focal_in(std::span<const uint8_t> block) {
  constexpr uint32_t kExifDirectory = 0x8769, kFocalIn35mm = 0xa405;
  const frames::ExifTags tags(block);
  const auto directory = tags.value(tags.first_directory(), kExifDirectory);
  if (!directory) return std::nullopt;
  const auto focal = tags.value(*directory, kFocalIn35mm);
  // 0 means unknown.
  if (!focal || *focal == 0 || *focal > 10000) return std::nullopt;
  return static_cast<double>(*focal);
}

/// Returns FocalLengthIn35mmFilm, in millimetres, from the bytes of a JPEG file; nothing if there
/// is none, also for damaged or other files.
[[nodiscard]] inline std::optional<double> stated_focal_35mm(std::span<const uint8_t> jpeg) {
  constexpr uint8_t kMarker = 0xff, kStart = 0xd8, kApp1 = 0xe1, kScan = 0xda;
  constexpr std::string_view kName("Exif\0\0", 6);
  if (jpeg.size() < 4 || jpeg[0] != kMarker || jpeg[1] != kStart) return std::nullopt;
  size_t at = 2;
  while (at + 4 <= jpeg.size() && jpeg[at] == kMarker && jpeg[at + 1] != kScan) {
    const size_t length = size_t{jpeg[at + 2]} << 8 | jpeg[at + 3];
    if (length < 2 || at + 2 + length > jpeg.size()) return std::nullopt;
    const std::span<const uint8_t> body = jpeg.subspan(at + 4, length - 2);
    if (jpeg[at + 1] == kApp1 && body.size() > kName.size() &&
        std::equal(kName.begin(), kName.end(), body.begin(),
                   [](char a, uint8_t b) { return static_cast<uint8_t>(a) == b; }))
      return focal_in(body.subspan(kName.size()));
    at += 2 + length;
  }
  return std::nullopt;
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
