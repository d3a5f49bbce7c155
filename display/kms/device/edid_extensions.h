// SPDX-License-Identifier: Apache-2.0
// The parts of an EDID's extension blocks (CTA-861, DisplayID) that decide what a link carries.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "display/kms/device/edid.h"

namespace lenticule::display {

struct EdidExtensions {
  bool offers_ycbcr = false;
  /// VICs (numbers of television modes) that the sink takes as YCbCr 4:2:0 and not otherwise.
  std::vector<uint8_t> only_as_420;
  /// Of DisplayID's display parameters.
  std::optional<PixelSize> displayid_native;
  /// Of the first progressive timing that DisplayID prefers.
  std::optional<PixelSize> displayid_preferred;
};

/// Reads every whole block after the first. Never throws for what the bytes say; half a block and
/// half a data block are left out.
[[nodiscard]] EdidExtensions read_extensions(std::span<const uint8_t> edid);

}  // namespace lenticule::display
