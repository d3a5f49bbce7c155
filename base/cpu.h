// SPDX-License-Identifier: Apache-2.0
// Which instruction set the kernels run with.
#pragma once

namespace lenticule {

enum class Isa { Baseline, Avx2, Avx512 };

/// The best that this processor and operating system support; the environment variable
/// LENTICULE_ISA (baseline, avx2, avx512) can ask for less, never for more. Throws a usage error
/// for any other name: a program asks once before anything else, so that later calls cannot throw.
[[nodiscard]] Isa best_isa();

/// Whether this machine can run `isa`.
[[nodiscard]] bool isa_supported(Isa isa);

[[nodiscard]] const char* isa_name(Isa isa);

/// Returns the best variant of a kernel that is no more than `isa` and that this machine can run.
template <class Kernel>
[[nodiscard]] const Kernel& select_kernel(Isa isa, const Kernel& baseline, const Kernel& avx2,
                                          const Kernel& avx512) {
  if (isa == Isa::Avx512 && isa_supported(Isa::Avx512)) return avx512;
  if (isa != Isa::Baseline && isa_supported(Isa::Avx2)) return avx2;
  return baseline;
}

}  // namespace lenticule

// Both are used in the namespace of a kernel, whose variants lenticule_isa_variants
// (cmake/LenticuleRoom.cmake) compiles: one declares the constant `name` of every variant, the
// other selects among them.
#if defined(__x86_64__)
#define LENTICULE_DECLARE_KERNEL(Kernel, name) \
  namespace isa_baseline {                     \
  extern const Kernel name;                    \
  }                                            \
  namespace isa_avx2 {                         \
  extern const Kernel name;                    \
  }                                            \
  namespace isa_avx512 {                       \
  extern const Kernel name;                    \
  }
#define LENTICULE_SELECT_KERNEL(isa, name) \
  ::lenticule::select_kernel(isa, isa_baseline::name, isa_avx2::name, isa_avx512::name)
#else
#define LENTICULE_DECLARE_KERNEL(Kernel, name) \
  namespace isa_baseline {                     \
  extern const Kernel name;                    \
  }
#define LENTICULE_SELECT_KERNEL(isa, name) \
  ::lenticule::select_kernel(isa, isa_baseline::name, isa_baseline::name, isa_baseline::name)
#endif
