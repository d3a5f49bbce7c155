// SPDX-License-Identifier: Apache-2.0
// Lists the instruction sets on which tests compare kernels. A machine that lacks one must run the
// best one below it, which the same tests check.
#pragma once

#include <array>

#include "base/cpu.h"

namespace lenticule::test {

[[nodiscard]] constexpr std::array<Isa, 4> every_instruction_set() {
  return {Isa::Baseline, Isa::Neon, Isa::Avx2, Isa::Avx512};
}

}  // namespace lenticule::test
