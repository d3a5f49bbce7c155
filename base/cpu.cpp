// SPDX-License-Identifier: Apache-2.0
#include "base/cpu.h"

#include <algorithm>
#include <cstdlib>
#include <string>

#include "base/error_kinds.h"

namespace lenticule {
namespace {

Isa best_of_machine() {
  if (isa_supported(Isa::Avx512)) return Isa::Avx512;
  if (isa_supported(Isa::Avx2)) return Isa::Avx2;
  if (isa_supported(Isa::Neon)) return Isa::Neon;
  return Isa::Baseline;
}

Isa named_isa(const std::string& name) {
  for (const Isa isa : {Isa::Baseline, Isa::Neon, Isa::Avx2, Isa::Avx512}) {
    if (name == isa_name(isa)) return isa;
  }
  throw usage_error("LENTICULE_ISA: no instruction set '{}'", name)
      .remedy("use baseline, neon, avx2 or avx512");
}

}  // namespace

bool isa_supported(Isa isa) {
#if defined(__x86_64__)
  // The builtins also ask the operating system (XGETBV), not only the processor.
  switch (isa) {
    case Isa::Baseline:
      return true;
    case Isa::Neon:
      return false;
    case Isa::Avx2:
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2");
    case Isa::Avx512:
      return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
             __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl");
  }
  return false;
#elif defined(__aarch64__)
  return isa <= Isa::Neon;  // every processor has it
#else
  return isa == Isa::Baseline;
#endif
}

Isa best_isa() {
  const char* requested = std::getenv("LENTICULE_ISA");
  if (requested == nullptr || *requested == '\0') return best_of_machine();
  const Isa isa = std::min(named_isa(requested), best_of_machine());
  return isa_supported(isa) ? isa : Isa::Baseline;
}

const char* isa_name(Isa isa) {
  constexpr const char* kNames[] = {"baseline", "neon", "avx2", "avx512"};
  return kNames[static_cast<size_t>(isa)];
}

}  // namespace lenticule
