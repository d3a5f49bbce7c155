// SPDX-License-Identifier: Apache-2.0
// The tap kernel's functions for an instruction set.
#pragma once

#include "base/cpu.h"
#include "frames/sequence/tap_kernel.h"

namespace lenticule::frames {

struct TapFunctions {
  bool (*decode_blocks)(const TapTable&, const TapStreams&, uint8_t*, size_t) noexcept;
  void (*encode_blocks)(const TapTable&, const uint8_t*, size_t, TapOutput&) noexcept;
  int (*tap_cost)(const uint8_t*, const uint8_t*) noexcept;
  size_t (*count_residuals)(const uint8_t*, size_t) noexcept;
  size_t (*count_bits)(const uint8_t*, size_t) noexcept;
};

/// `isa` must be supported by this machine.
[[nodiscard]] const TapFunctions& tap_functions(Isa isa);

}  // namespace lenticule::frames
