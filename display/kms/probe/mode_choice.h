// SPDX-License-Identifier: Apache-2.0
// The one mode in which a panel shows frames pixel for pixel.
#pragma once

#include <optional>
#include <vector>

#include "display/kms/device/connector.h"
#include "display/kms/device/edid.h"
#include "frames/frame.h"

namespace lenticule::display {

/// The sizes that are the panel's own, pixel for pixel; it would scale a picture of any other size,
/// even one that it lists. Those of the modes that the kernel prefers, else what the EDID calls its
/// own (EdidReading::native_sizes()). Empty where nobody knows: without an EDID a preferred mode is
/// the driver's choice, as in virtual machines.
[[nodiscard]] std::vector<PixelSize> native_sizes(const ConnectorInfo& connector);
/// True as well where nobody knows.
[[nodiscard]] bool may_be_native(const ConnectorInfo& connector, PixelSize size);

/// Progressive, each line once.
[[nodiscard]] bool is_plain(const drmModeModeInfo& mode);
/// The panel lists a mode with these timings, and it may be of its native size.
[[nodiscard]] bool offers_mode(const ConnectorInfo& connector, const drmModeModeInfo& mode);

/// The plain mode of exactly this size, if it may be native: with `refresh` the one nearest to it
/// within 0.05 %, otherwise the preferred one, otherwise the fastest.
[[nodiscard]] std::optional<drmModeModeInfo> choose_mode(const ConnectorInfo& connector,
                                                         const frames::FrameGeometry& panel,
                                                         std::optional<frames::Rate> refresh);

/// As above; throws Error(Input) that says what the panel has. Never a smaller mode instead.
[[nodiscard]] drmModeModeInfo require_mode(const ConnectorInfo& connector,
                                           const frames::FrameGeometry& panel,
                                           std::optional<frames::Rate> refresh);

}  // namespace lenticule::display
