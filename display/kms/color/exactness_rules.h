// SPDX-License-Identifier: Apache-2.0
// Lists every KMS property that can change a subpixel between the buffer and the panel, with its
// neutral value.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "display/kms/device/drm_properties.h"
#include "display/scanout_depth.h"

namespace lenticule::display {

enum class KmsObject { Connector, Crtc, Plane };
[[nodiscard]] const char* object_name(KmsObject object);

/// The way to find the neutral value.
enum class Neutral {
  Number,   ///< `number`
  Named,    ///< the enumerator with one of `names`, the first that exists
  Maximum,  ///< the largest value of the range
  Centre,   ///< the middle of 0 ... 100; unknown for other ranges
  Depth,    ///< bits per colour of the frames; `names` for 8 and 10 bits, if the values have names
  Kept,     ///< read-only: must be one of `names` (or `number`), never written
};

/// Effect of a wrong value.
enum class Harm {
  Pixels,      ///< subpixels arrive changed
  Processing,  ///< it may make the panel process the picture
};

struct ExactnessRule {
  KmsObject object;
  const char* property;
  Neutral neutral;
  uint64_t number;
  const char* names[4];
  Harm harm;
  const char* effect;  ///< effect of any other value
  const char* remedy;  ///< remedy if it cannot be set
};

[[nodiscard]] std::span<const ExactnessRule> exactness_rules();

/// Returns the neutral value of this property on this driver, for frames of this depth; none if the
/// driver has no such value.
[[nodiscard]] std::optional<uint64_t> neutral_value(const ExactnessRule& rule,
                                                    const Property& property, ScanoutDepth depth);

}  // namespace lenticule::display
