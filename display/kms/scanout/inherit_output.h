// SPDX-License-Identifier: Apache-2.0
// Takes over an active output from the previous player, and describes one for the next player.
#pragma once

#include <optional>

#include "display/kms/device/drm_device.h"
#include "display/kms/scanout/handover.h"
#include "display/kms/scanout/kms_display.h"
#include "display/kms/scanout/lit_output.h"

namespace lenticule::display {

[[nodiscard]] HandoverState describe_output(const LitOutput& lit, frames::FrameGeometry geometry);

/// Takes over the output in `options.inherited`, which is reset; none if any part of the state does
/// not match, and then its buffers are freed. If the inherited card is not taken over, it is
/// returned in `card`. All services in `options` must be set.
[[nodiscard]] std::optional<LitOutput> inherit_output(const KmsOptions& options,
                                                      std::optional<DrmDevice>& card);

}  // namespace lenticule::display
