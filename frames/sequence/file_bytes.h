// SPDX-License-Identifier: Apache-2.0
// Reads and writes whole byte ranges of a file at 64-bit offsets.
#pragma once

#include <cstdint>
#include <span>

namespace lenticule::frames {

/// Returns the size of an open file; 0 if the size is unknown.
[[nodiscard]] uint64_t size_of(int fd) noexcept;

/// Returns false at the end of the file and for errors; `to` is undefined then.
[[nodiscard]] bool read_at(int fd, uint64_t offset, std::span<uint8_t> to) noexcept;

/// Returns false if not all bytes could be written; errno has the cause.
[[nodiscard]] bool write_at(int fd, uint64_t offset, std::span<const uint8_t> from) noexcept;

}  // namespace lenticule::frames
