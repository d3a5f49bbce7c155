// SPDX-License-Identifier: Apache-2.0
// What a payload of the tap codec decodes to, byte by byte, as docs/formats.md says it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace lenticule::test {

/// Fails the running test for a payload that breaks the format.
std::vector<uint8_t> oracle_decode_taps(std::span<const uint8_t> payload, size_t band_bytes);

}  // namespace lenticule::test
