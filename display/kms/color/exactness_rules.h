// SPDX-License-Identifier: Apache-2.0
// Every KMS property that can change a subpixel between the buffer and the glass, and the value
// with which it does not.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "display/kms/device/drm_properties.h"

namespace lenticule::display {

enum class KmsObject { Connector, Crtc, Plane };
[[nodiscard]] const char* object_name(KmsObject object);

/// How the neutral value is found.
enum class Neutral {
  Number,   ///< `number`
  Named,    ///< the enumerator with one of `names`, the first that exists
  Maximum,  ///< the largest value of the range
  Centre,   ///< the middle of 0 ... 100; of other ranges it is not known
  Kept,     ///< read only: it must be one of `names` (or `number`), nobody may write it
};

/// What a wrong value does.
enum class Harm {
  Pixels,      ///< subpixels arrive changed
  Processing,  ///< it invites the panel to process the picture
};

struct ExactnessRule {
  KmsObject object;
  const char* property;
  Neutral neutral;
  uint64_t number;
  const char* names[4];
  Harm harm;
  const char* effect;  ///< of any other value
  const char* remedy;  ///< when it cannot be set
};

[[nodiscard]] std::span<const ExactnessRule> exactness_rules();

/// The neutral value of this property on this driver; none if the driver knows no such value.
[[nodiscard]] std::optional<uint64_t> neutral_value(const ExactnessRule& rule,
                                                    const Property& property);

}  // namespace lenticule::display
