// SPDX-License-Identifier: Apache-2.0
// LightEncoder converts light to code values and to fractions of code values.
#pragma once

#include <cstdint>
#include <vector>

#include "frames/linear_codes.h"
#include "frames/srgb.h"

namespace lenticule::render {

/// LightEncoder encodes light, which is linear in colour-managed scenes and already encoded in
/// others. Thread safety: immutable.
class LightEncoder {
 public:
  explicit LightEncoder(bool colour_managed);

  /// Returns the code value in units of 1 / kCodeParts, to within one unit; clipped
  /// to 0 ... 255 codes.
  [[nodiscard]] uint16_t parts(float light) const;
  /// Returns the code value as method full writes it.
  [[nodiscard]] uint8_t code(float light) const {
    if (linear_ == nullptr) return frames::code_from_encoded(light);
    const float above = light > 0.0F ? light : 0.0F;
    if (above >= 1.0F) return 255;
    const auto bin = static_cast<int32_t>(above * float{frames::LinearCodes::kBins});
    return static_cast<uint8_t>(linear_->first[bin] + (above >= linear_->limit[bin] ? 1 : 0));
  }

 private:
  const frames::LinearCodes* linear_ = nullptr;  ///< table of codes; null if not colour managed
  std::vector<float> knots_;  ///< uniform in the root of linear light; empty if not colour managed
};

}  // namespace lenticule::render
