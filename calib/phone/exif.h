// SPDX-License-Identifier: Apache-2.0
// Reads the focal length that a camera states in a JPEG file (EXIF 2.3), and removes what else the
// file says of place, time and owner.
#pragma once

#include <algorithm>
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

/// Returns a JPEG file without application data, comments and what follows the picture, which may
/// be a film: only orientation and focal length stay, as a new EXIF block. The pixels are not coded
/// again. Returns nothing for other files; damage stays where it is.
[[nodiscard]] inline std::vector<uint8_t> anonymous_jpeg(std::span<const uint8_t> jpeg) {
  constexpr uint8_t kMark = 0xff, kStart = 0xd8, kEnd = 0xd9, kScan = 0xda, kComment = 0xfe;
  constexpr uint8_t kApp0 = 0xe0, kAdobe = 0xee, kApp15 = 0xef;  // Adobe's tells the colour space
  if (jpeg.size() < 4 || jpeg[0] != kMark || jpeg[1] != kStart) return {};
  const auto orientation =
      static_cast<uint8_t>(frames::ExifTags(frames::exif_of_jpeg(jpeg)).orientation());
  const auto focal = static_cast<unsigned>(stated_focal_35mm(jpeg).value_or(0.0));
  const auto high = static_cast<uint8_t>(focal >> 8), low = static_cast<uint8_t>(focal & 255U);
  std::vector<uint8_t> out = {
      kMark, kStart, kMark, 0xe1, 0, 64, 'E', 'x', 'i',  'f',         0, 0, 'M',  'M',  0, 42,
      0,     0,      0,     8,    0, 2,  // big-endian; two entries
      0x01,  0x12,   0,     3,    0, 0,  0,   1,   0,    orientation, 0, 0, 0x87, 0x69, 0, 4,
      0,     0,      0,     1,    0, 0,  0,   38,  // entries of EXIF at 38
      0,     0,      0,     0,    0, 1,            // one entry
      0xa4,  0x05,   0,     3,    0, 0,  0,   1,   high, low,         0, 0, 0,    0,    0, 0};
  const auto keep = [&](size_t from, size_t to) {
    out.insert(out.end(), jpeg.begin() + static_cast<ptrdiff_t>(from),
               jpeg.begin() + static_cast<ptrdiff_t>(to));
  };
  size_t at = 2;
  while (at + 4 <= jpeg.size() && jpeg[at] == kMark && jpeg[at + 1] != kEnd) {
    const uint8_t marker = jpeg[at + 1];
    const size_t length = marker == kMark ? 1 : 2 + (size_t{jpeg[at + 2]} << 8 | jpeg[at + 3]);
    size_t end = std::min(at + length, jpeg.size());
    // Coded pixels follow a scan: in them a mark precedes 0 or the number of a restart.
    const auto coded = [&](uint8_t next) { return next == 0 || (next >= 0xd0 && next <= 0xd7); };
    if (marker == kScan)
      while (end + 1 < jpeg.size() && (jpeg[end] != kMark || coded(jpeg[end + 1]))) ++end;
    const bool application = marker >= kApp0 && marker <= kApp15 && marker != kAdobe;
    if (marker != kMark && marker != kComment && !application) keep(at, end);
    at = end;
  }
  out.insert(out.end(), {kMark, kEnd});
  return out;
}

}  // namespace lenticule::calib
