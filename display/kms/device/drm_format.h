// SPDX-License-Identifier: Apache-2.0
// Names the kernel's codes of the formats that frames are scanned out in.
#pragma once

#include <drm_fourcc.h>

#include <cstdint>

#include "display/scanout_depth.h"

namespace lenticule::display {

[[nodiscard]] constexpr uint32_t drm_format(ScanoutDepth depth) {
  return depth == ScanoutDepth::Bits10 ? DRM_FORMAT_XRGB2101010 : DRM_FORMAT_XRGB8888;
}

}  // namespace lenticule::display
