// SPDX-License-Identifier: Apache-2.0
// ExifTags reads whole numbers of an EXIF block, as JPEG and PNG files carry it (EXIF 2.3: a TIFF
// header and directories).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

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

}  // namespace lenticule::frames
