// SPDX-License-Identifier: Apache-2.0
// Reads the focal length that a camera states in a JPEG file (EXIF 2.3), and removes what else the
// file says of place, time and owner.
#pragma once

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

/// Returns the picture of a JPEG file, without new coding, and its focal length: tables, scans, and
/// Adobe's mark of the colour space stay; all other segments go, and so does what follows the
/// picture, which may be a film. Returns nothing for other files. A damaged segment ends the
/// result.
[[nodiscard]] inline std::vector<uint8_t> anonymous_jpeg(std::span<const uint8_t> jpeg) {
  constexpr uint8_t kMark = 0xff, kStart = 0xd8, kEnd = 0xd9, kScan = 0xda, kAdobe = 0xee;
  if (jpeg.size() < 4 || jpeg[0] != kMark || jpeg[1] != kStart) return {};
  const auto focal = static_cast<unsigned>(stated_focal_35mm(jpeg).value_or(0.0));
  const auto high = static_cast<uint8_t>(focal >> 8), low = static_cast<uint8_t>(focal & 255U);
  std::vector<uint8_t> out = {
      kMark, kStart, kMark, 0xe1, 0, 52, 'E',  'x',  'i', 'f', 0,    0,  // a segment of 52 bytes
      'M',   'M',    0,     42,   0, 0,  0,    8,    0,   1,   0x87, 0x69,
      0,     4,      0,     0,    0, 1,  0,    0,    0,   26,  // EXIF at 26
      0,     0,      0,     0,    0, 1,  0xa4, 0x05, 0,   3,   0,    0,
      0,     1,      high,  low,  0, 0,  0,    0,    0,   0};
  // Marks without a length: fill, and starts and restarts in coded pixels.
  const auto alone = [](uint8_t m) { return m <= 1 || (m >= 0xd0 && m <= kStart) || m == kMark; };
  const auto kept = [](uint8_t m, std::string_view body) {
    return (m >= 0xc0 && m <= 0xcf && m != 0xc8) || (m >= kScan && m <= 0xdd) ||
           (m == kAdobe && body.size() == 12 && body.starts_with("Adobe"));
  };
  bool pixels = false;
  for (size_t at = 2; at + 1 < jpeg.size();) {
    const uint8_t mark = jpeg[at + 1];
    if (jpeg[at] != kMark || alone(mark)) {
      if (pixels) out.push_back(jpeg[at]);
      ++at;
      continue;
    }
    if (mark == kEnd || at + 4 > jpeg.size()) break;
    const size_t end = at + 2 + (size_t{jpeg[at + 2]} << 8 | jpeg[at + 3]);
    if (end < at + 4 || end > jpeg.size()) break;
    const std::string_view body(reinterpret_cast<const char*>(jpeg.data()) + at + 4, end - at - 4);
    if (kept(mark, body))
      out.insert(out.end(), jpeg.begin() + static_cast<ptrdiff_t>(at),
                 jpeg.begin() + static_cast<ptrdiff_t>(end));
    pixels = mark == kScan;
    at = end;
  }
  out.insert(out.end(), {kMark, kEnd});
  return out;
}

}  // namespace lenticule::calib
