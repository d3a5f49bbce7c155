// SPDX-License-Identifier: Apache-2.0
// What the kernel tells about an output outside its KMS properties: files of sysfs, which anyone
// may read, and of debugfs, which root may.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "display/kms/color/exactness_report.h"
#include "display/kms/device/platform.h"

namespace lenticule::display {

/// Names of the rows that others look for.
inline constexpr const char* kDepthRow = "depth and dithering";
inline constexpr const char* kCompressionRow = "DSC";

struct LinkPlace {
  std::string card;       ///< path of the node, /dev/dri/cardN
  std::string connector;  ///< "eDP-1"
  uint32_t crtc = 0;
};

/// A row for each file that could be read and understood; none for the others.
[[nodiscard]] std::vector<AuditRow> read_sysfs_rows(KmsPlatform& platform, const LinkPlace& place);
/// As above. The driver takes its locks to answer, so this is for moments without flips.
[[nodiscard]] std::vector<AuditRow> read_debugfs_rows(KmsPlatform& platform,
                                                      const LinkPlace& place);

}  // namespace lenticule::display
