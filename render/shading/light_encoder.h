// SPDX-License-Identifier: Apache-2.0
// Light as code values and as parts of them.
#pragma once

#include <cstdint>
#include <vector>

namespace lenticule::render {

/// Immutable. Light is linear in colour-managed scenes, encoded in others.
class LightEncoder {
 public:
  explicit LightEncoder(bool colour_managed);

  /// In lookup_kernel::kCodeParts of a code value, within one part; clipped to 0 ... 255 codes.
  [[nodiscard]] uint16_t parts(float light) const;
  /// As method full writes it.
  [[nodiscard]] uint8_t code(float light) const;

 private:
  std::vector<float> knots_;  ///< even in the square root of linear light; empty if not managed
};

}  // namespace lenticule::render
