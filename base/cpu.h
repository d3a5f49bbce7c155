// SPDX-License-Identifier: Apache-2.0
// Which instruction set the kernels run with.
#pragma once

namespace lenticule {

enum class Isa { Baseline, Avx2, Avx512 };

/// The best that this processor and operating system support; the environment variable
/// LENTICULE_ISA (baseline, avx2, avx512) can ask for less, never for more.
[[nodiscard]] Isa best_isa();

/// Whether this machine can run `isa`.
[[nodiscard]] bool isa_supported(Isa isa);

[[nodiscard]] const char* isa_name(Isa isa);

}  // namespace lenticule
