// SPDX-License-Identifier: Apache-2.0
// Selects the instruction set of the compute kernels.
#pragma once

namespace lenticule {

/// Isa is the instruction set that a kernel is written for. A machine can run Baseline (code
/// without intrinsics), and either Neon or, in ascending order, Avx2 and Avx512.
enum class Isa { Baseline, Neon, Avx2, Avx512 };

/// Returns the best instruction set that the processor and the operating system support. The
/// environment variable LENTICULE_ISA (baseline, neon, avx2, avx512) can select a smaller set,
/// never a larger one. Throws a usage error for any other name of a set: a program calls this
/// function once before anything else, so that later calls cannot throw.
[[nodiscard]] Isa best_isa();

/// Returns true if this machine can run `isa`.
[[nodiscard]] bool isa_supported(Isa isa);

[[nodiscard]] const char* isa_name(Isa isa);

/// Returns the best variant of a kernel that does not exceed `isa` and that this machine can run.
template <class Kernel>
[[nodiscard]] const Kernel& select_kernel(Isa isa, const Kernel& baseline, const Kernel& avx2,
                                          const Kernel& avx512) {
  if (isa == Isa::Avx512 && isa_supported(Isa::Avx512)) return avx512;
  if (isa >= Isa::Avx2 && isa_supported(Isa::Avx2)) return avx2;
  return baseline;
}

/// Does the same on arm64.
template <class Kernel>
[[nodiscard]] const Kernel& select_kernel(Isa isa, const Kernel& baseline, const Kernel& neon) {
  return isa != Isa::Baseline && isa_supported(Isa::Neon) ? neon : baseline;
}

}  // namespace lenticule

// Both macros are used in the namespace of a kernel. lenticule_isa_variants
// (cmake/LenticuleLibrary.cmake) compiles the kernel's variants. The first macro declares the
// constant `name` of every variant, the second one selects a variant.
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
#elif defined(__aarch64__)
#define LENTICULE_DECLARE_KERNEL(Kernel, name) \
  namespace isa_baseline {                     \
  extern const Kernel name;                    \
  }                                            \
  namespace isa_neon {                         \
  extern const Kernel name;                    \
  }
#define LENTICULE_SELECT_KERNEL(isa, name) \
  ::lenticule::select_kernel(isa, isa_baseline::name, isa_neon::name)
#else
#define LENTICULE_DECLARE_KERNEL(Kernel, name) \
  namespace isa_baseline {                     \
  extern const Kernel name;                    \
  }
#define LENTICULE_SELECT_KERNEL(isa, name) \
  ::lenticule::select_kernel(isa, isa_baseline::name, isa_baseline::name)
#endif
