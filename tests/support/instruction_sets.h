// SPDX-License-Identifier: Apache-2.0
// What kernels can be compared on here. A test with one instance for each judges something on every
// machine.
#pragma once

#include <vector>

#include "base/cpu.h"

namespace lenticule::test {

[[nodiscard]] inline std::vector<Isa> instruction_sets_of_this_machine() {
  std::vector<Isa> sets = {Isa::Baseline, Isa::Avx2, Isa::Avx512};
  std::erase_if(sets, [](Isa isa) { return !isa_supported(isa); });
  return sets;
}

}  // namespace lenticule::test
