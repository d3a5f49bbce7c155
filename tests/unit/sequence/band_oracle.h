// SPDX-License-Identifier: Apache-2.0
// Decodes a payload of the predictor codec byte by byte, as docs/content/formats.md specifies it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace lenticule::test {

/// Decodes a payload; fails the running test if the payload breaks the format.
std::vector<uint8_t> oracle_decode_predicted(std::span<const uint8_t> payload, size_t band_bytes);

}  // namespace lenticule::test
