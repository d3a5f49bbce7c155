// SPDX-License-Identifier: Apache-2.0
// The instruction sets that tests compare kernels on. A machine that lacks one must run the best
// below it: the same tests judge both.
#pragma once

#include <array>

#include "base/cpu.h"

namespace lenticule::test {

[[nodiscard]] constexpr std::array<Isa, 3> every_instruction_set() {
  return {Isa::Baseline, Isa::Avx2, Isa::Avx512};
}

}  // namespace lenticule::test
