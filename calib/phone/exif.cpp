// SPDX-License-Identifier: Apache-2.0
#include "calib/phone/exif.h"

#include <algorithm>
#include <fstream>
#include <string_view>
#include <vector>

namespace lenticule::calib {
namespace {

/// Tiff reads numbers of a TIFF block in either byte order; beyond its end everything is 0.
class Tiff {
 public:
  explicit Tiff(std::span<const uint8_t> bytes)
      : bytes_(bytes), big_(bytes.size() >= 2 && bytes[0] == 'M') {}
  [[nodiscard]] uint32_t number(size_t at, size_t count) const {
    if (at > bytes_.size() || count > bytes_.size() - at) return 0;
    uint32_t value = 0;
    for (size_t k = 0; k < count; ++k) value = value << 8 | bytes_[at + (big_ ? k : count - 1 - k)];
    return value;
  }
  /// Returns the value of a tag in the directory at `at`, for the types short and long.
  [[nodiscard]] std::optional<uint32_t> value(size_t at, uint32_t tag) const {
    constexpr size_t kEntry = 12;
    constexpr uint32_t kShort = 3, kLong = 4;
    const uint32_t count = number(at, 2);
    for (uint32_t k = 0; k < count; ++k) {
      const size_t entry = at + 2 + kEntry * k;
      if (entry + kEntry > bytes_.size()) return std::nullopt;
      if (number(entry, 2) != tag) continue;
      const uint32_t type = number(entry + 2, 2);
      if (type == kShort) return number(entry + 8, 2);
      if (type == kLong) return number(entry + 8, 4);
      return std::nullopt;
    }
    return std::nullopt;
  }

 private:
  std::span<const uint8_t> bytes_;
  bool big_;
};

std::optional<double> focal_in(std::span<const uint8_t> block) {
  constexpr uint32_t kExifDirectory = 0x8769, kFocalIn35mm = 0xa405;
  const Tiff tiff(block);
  const auto directory = tiff.value(tiff.number(4, 4), kExifDirectory);
  if (!directory) return std::nullopt;
  const auto focal = tiff.value(*directory, kFocalIn35mm);
  // 0 means unknown.
  if (!focal || *focal == 0 || *focal > 10000) return std::nullopt;
  return static_cast<double>(*focal);
}

}  // namespace

std::optional<double> stated_focal_35mm(std::span<const uint8_t> jpeg) {
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

std::optional<double> stated_focal_35mm(const std::filesystem::path& file) {
  constexpr size_t kFirst = size_t{1} << 18;  // EXIF is at most 64 KiB, near the start
  std::ifstream in(file, std::ios::binary);
  std::vector<char> text(kFirst);
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  const std::vector<uint8_t> bytes(text.begin(), text.begin() + in.gcount());
  return stated_focal_35mm(std::span<const uint8_t>(bytes));
}

Estimate focal_of_film(double focal_35mm, int longer_side_px) {
  constexpr double kFilmMm = 36.0, kSigma = 0.03;
  const double focal = focal_35mm / kFilmMm * longer_side_px;
  return {focal, kSigma * focal};
}

}  // namespace lenticule::calib
