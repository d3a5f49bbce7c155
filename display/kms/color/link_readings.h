// SPDX-License-Identifier: Apache-2.0
// Reads facts about an output that are not KMS properties: from sysfs, readable by every user, and
// from debugfs, readable by root.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "display/kms/color/exactness_report.h"
#include "display/kms/device/platform.h"
#include "display/scanout_depth.h"

namespace lenticule::display {

/// Names of rows that other code looks up.
inline constexpr const char* kDepthRow = "depth and dithering";
inline constexpr const char* kCompressionRow = "DSC";

struct LinkPlace {
  std::string card;       ///< path of the card's node, /dev/dri/cardN
  std::string connector;  ///< "eDP-1"
  uint32_t crtc = 0;
  ScanoutDepth depth = ScanoutDepth::Bits8;  ///< depth of the frames that are scanned out
};

/// Returns a row for each sysfs file that could be read and parsed.
[[nodiscard]] std::vector<AuditRow> read_sysfs_rows(KmsPlatform& platform, const LinkPlace& place);
/// Returns a row for each debugfs file that could be read and parsed. The driver takes locks to
/// answer, so call it only while no flips are pending.
[[nodiscard]] std::vector<AuditRow> read_debugfs_rows(KmsPlatform& platform,
                                                      const LinkPlace& place);

}  // namespace lenticule::display
