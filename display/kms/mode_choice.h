// SPDX-License-Identifier: Apache-2.0
// The one mode in which a panel shows frames pixel for pixel.
#pragma once

#include <optional>
#include <vector>

#include "display/kms/connector.h"
#include "frames/frame.h"

namespace lenticule::display {

/// The panel's own mode: of its exact size, progressive, each line once. With `refresh` the one
/// nearest to it within 0.05 %, otherwise the preferred one, otherwise the fastest. None if the
/// panel has no such mode.
[[nodiscard]] std::optional<drmModeModeInfo> choose_mode(const std::vector<drmModeModeInfo>& modes,
                                                         const frames::FrameGeometry& panel,
                                                         std::optional<frames::Rate> refresh);

/// As above; throws Error(Input) that lists the panel's modes. Never a smaller mode instead.
[[nodiscard]] drmModeModeInfo require_mode(const ConnectorInfo& connector,
                                           const frames::FrameGeometry& panel,
                                           std::optional<frames::Rate> refresh);

}  // namespace lenticule::display
