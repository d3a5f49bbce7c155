// SPDX-License-Identifier: Apache-2.0
// Reads the parts of an EDID's extension blocks (CTA-861, DisplayID) that determine a link's
// encoding.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "display/kms/device/edid.h"

namespace lenticule::display {

struct EdidExtensions {
  bool offers_ycbcr = false;
  bool deep_colour = false;  ///< the HDMI input accepts RGB of 10 bits per colour
  /// VICs (numbers of television modes) that the sink accepts as YCbCr 4:2:0 only.
  std::vector<uint8_t> only_as_420;
  /// Size in DisplayID's display parameters.
  std::optional<PixelSize> displayid_native;
  /// Size of the first progressive timing that DisplayID prefers.
  std::optional<PixelSize> displayid_preferred;
};

/// Parses every complete block after the first. Never throws because of the contents; incomplete
/// blocks and data blocks are skipped.
[[nodiscard]] EdidExtensions read_extensions(std::span<const uint8_t> edid);

}  // namespace lenticule::display
