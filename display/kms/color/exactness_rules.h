// SPDX-License-Identifier: Apache-2.0
// Lists what can change a subpixel between the buffer and the panel: the processing in each kernel
// driver, and every KMS property, with its neutral value.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "display/kms/device/drm_properties.h"
#include "display/scanout_depth.h"

namespace lenticule::display {

// Lists how kernel drivers process an XRGB8888 frame on its way out, according to their sources. A
// driver does not report this: all accept the format, and some convert it internally.

enum class PathKind {
  AsItIs,  ///< every subpixel leaves the driver unchanged
  Alters,  ///< subpixels are rounded, compressed, scaled or late
};

struct DriverPath {
  const char* driver;  ///< name that DRM_IOCTL_VERSION returns
  PathKind kind;
  const char* fact;
  /// File and function in the kernel's sources, or the manufacturer's documentation.
  const char* source;
  /// Fact about frames in XRGB2101010; null if the sources were read for XRGB8888 only.
  const char* fact_of_ten_bits = nullptr;
};

[[nodiscard]] std::span<const DriverPath> driver_paths();
/// Returns null for a driver that is not listed.
[[nodiscard]] const DriverPath* find_driver_path(std::string_view driver);

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
  std::array<const char*, 4> names;
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
