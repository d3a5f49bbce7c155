// SPDX-License-Identifier: Apache-2.0
// ExifTags reads numbers of an EXIF block, as JPEG and PNG files carry it (EXIF 2.3: a TIFF
// header and directories).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "frames/image_io.h"

namespace lenticule::frames {

/// Any bytes may be read: beyond their end everything is 0.
///
/// Lifetime: the bytes must outlive the object. Thread safety: any thread.
class ExifTags {
 public:
  explicit ExifTags(std::span<const uint8_t> block)
      : bytes_(block), big_endian_(block.size() >= 2 && block[0] == 'M') {}

  /// Returns the offset of the first directory, which has the picture's own tags.
  [[nodiscard]] size_t first_directory() const { return number(4, 4); }

  /// Returns the value of a tag in the directory at `at`, for the types short and long.
  [[nodiscard]] std::optional<uint32_t> value(size_t at, uint32_t tag) const {
    constexpr uint32_t kShort = 3, kLong = 4;
    if (const auto entry = entry_of(at, tag, kShort)) return number(*entry + 8, 2);
    if (const auto entry = entry_of(at, tag, kLong)) return number(*entry + 8, 4);
    return std::nullopt;
  }

  /// Returns the value of a picture's own tag of the type rational; 0 if there is none.
  [[nodiscard]] double ratio(uint32_t tag) const {
    constexpr uint32_t kRational = 5;
    const auto entry = entry_of(first_directory(), tag, kRational);
    const size_t place = entry ? number(*entry + 8, 4) : bytes_.size();
    const uint32_t divisor = number(place + 4, 4);
    return divisor == 0 ? 0.0 : static_cast<double>(number(place, 4)) / divisor;
  }

  /// Returns the picture's orientation; Upright if the tag is missing or invalid.
  [[nodiscard]] Orientation orientation() const {
    constexpr uint32_t kOrientation = 0x0112;
    const uint32_t tag = value(first_directory(), kOrientation).value_or(1);
    return tag >= 1 && tag <= 8 ? static_cast<Orientation>(tag) : Orientation::Upright;
  }

 private:
  /// Returns the offset of the first entry of a tag and type in a directory.
  [[nodiscard]] std::optional<size_t> entry_of(size_t at, uint32_t tag, uint32_t type) const {
    constexpr size_t kEntry = 12;
    const uint32_t count = number(at, 2);
    for (uint32_t k = 0; k < count; ++k) {
      const size_t entry = at + 2 + kEntry * k;
      if (entry + kEntry > bytes_.size()) break;
      if (number(entry, 2) == tag && number(entry + 2, 2) == type) return entry;
    }
    return std::nullopt;
  }

  [[nodiscard]] uint32_t number(size_t at, size_t count) const {
    if (at > bytes_.size() || count > bytes_.size() - at) return 0;
    uint32_t value = 0;
    for (size_t k = 0; k < count; ++k)
      value = value << 8 | bytes_[at + (big_endian_ ? k : count - 1 - k)];
    return value;
  }

  std::span<const uint8_t> bytes_;
  bool big_endian_;
};

/// Returns what follows `mark` in the first segment of a JPEG file with that marker and mark;
/// nothing if there is none before the pixels, also for damaged or other files.
[[nodiscard]] inline std::span<const uint8_t> jpeg_segment(std::span<const uint8_t> jpeg,
                                                           uint8_t marker, std::string_view mark) {
  constexpr uint8_t kMarker = 0xff, kStart = 0xd8, kScan = 0xda;
  if (jpeg.size() < 4 || jpeg[0] != kMarker || jpeg[1] != kStart) return {};
  size_t at = 2;
  while (at + 4 <= jpeg.size() && jpeg[at] == kMarker && jpeg[at + 1] != kScan) {
    if (jpeg[at + 1] == kMarker) {  // fill
      ++at;
      continue;
    }
    const size_t length = size_t{jpeg[at + 2]} << 8 | jpeg[at + 3];
    if (length < 2 || at + 2 + length > jpeg.size()) return {};
    const std::span<const uint8_t> body = jpeg.subspan(at + 4, length - 2);
    const std::string_view text(reinterpret_cast<const char*>(body.data()), body.size());
    if (jpeg[at + 1] == marker && text.starts_with(mark)) return body.subspan(mark.size());
    at += 2 + length;
  }
  return {};
}

/// Returns the EXIF block of a JPEG file; nothing if there is none.
[[nodiscard]] inline std::span<const uint8_t> exif_of_jpeg(std::span<const uint8_t> jpeg) {
  return jpeg_segment(jpeg, 0xe1, std::string_view("Exif\0\0", 6));
}

}  // namespace lenticule::frames
