// SPDX-License-Identifier: Apache-2.0
// Makes EDIDs of every kind from a number; the same on every machine.
#pragma once

#include <cstdint>
#include <vector>

namespace lenticule::test {

/// Returns an EDID with correct checksums: a base block of revision 1.3 or 1.4 with random fields,
/// and up to three extension blocks of CTA-861 (revisions 1 to 3) and DisplayID (1.2, 1.3 and 2.0).
[[nodiscard]] std::vector<uint8_t> random_edid(uint64_t number);

}  // namespace lenticule::test
