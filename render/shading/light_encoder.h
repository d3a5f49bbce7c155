// SPDX-License-Identifier: Apache-2.0
// LightEncoder converts light to code values and to fractions of code values.
#pragma once

#include <cstdint>
#include <vector>

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
  [[nodiscard]] uint8_t code(float light) const;

 private:
  std::vector<float> knots_;  ///< uniform in the root of linear light; empty if not colour managed
};

}  // namespace lenticule::render
