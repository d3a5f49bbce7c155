// SPDX-License-Identifier: Apache-2.0
// Turns the exposure of a sensor into codes as phones do: merged exposures, interpolated colours,
// local tone mapping, a contrast curve and sharpening.
#pragma once

#include "apps/lenticule-bench/phone/exposure.h"
#include "apps/lenticule-bench/phone/phone_photo.h"

namespace lenticule::bench {

/// Returns the photograph of an exposure, with the wall around its window; EXIF data are missing.
/// `hdr` merges two exposures and maps the tones strongly.
[[nodiscard]] Photo develop(Mosaic mosaic, const Phone& phone, bool hdr);

}  // namespace lenticule::bench
