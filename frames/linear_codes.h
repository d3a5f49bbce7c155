// SPDX-License-Identifier: Apache-2.0
// LinearCodes finds the code values of many values of linear light in single precision. Plain data
// only: kernels that are compiled for one instruction set include this header.
#pragma once

#include <cstdint>

namespace lenticule::frames {

/// LinearCodes divides [0, 1) into equal bins, each with at most one limit between two codes. Light
/// in bin b has the code first[b], or the next one if it is at least limit[b]. The codes are those
/// of code_from_linear().
struct LinearCodes {
  static constexpr int32_t kBins = 4096;

  int32_t first[kBins];
  float limit[kBins];  ///< infinite in bins without a limit
};

/// Returns the table. Thread safety: any thread.
[[nodiscard]] const LinearCodes& linear_codes();

}  // namespace lenticule::frames
