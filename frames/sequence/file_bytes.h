// SPDX-License-Identifier: Apache-2.0
// Whole pieces of a file, read and written at 64-bit offsets.
#pragma once

#include <cstdint>
#include <span>

namespace lenticule::frames {

/// Size of an open file; 0 if that cannot be told.
[[nodiscard]] uint64_t size_of(int fd) noexcept;

/// False at the end of the file and for errors; `to` holds anything then.
[[nodiscard]] bool read_at(int fd, uint64_t offset, std::span<uint8_t> to) noexcept;

/// False if not all could be written; errno says why.
[[nodiscard]] bool write_at(int fd, uint64_t offset, std::span<const uint8_t> from) noexcept;

}  // namespace lenticule::frames
