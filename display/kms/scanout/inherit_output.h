// SPDX-License-Identifier: Apache-2.0
// From one player to the next: what to tell about a lit output, and how to go on in its buffers.
#pragma once

#include <optional>

#include "display/kms/device/drm_device.h"
#include "display/kms/scanout/handover.h"
#include "display/kms/scanout/kms_display.h"
#include "display/kms/scanout/lit_output.h"

namespace lenticule::display {

[[nodiscard]] HandoverState describe_output(const LitOutput& lit, frames::FrameGeometry geometry);

/// Goes on with what `options.inherited` says, which is used up; none when anything is not as it
/// says, and then its buffers are freed. The inherited card is left in `card` if it is one and was
/// not taken over. `options` has all services filled in.
[[nodiscard]] std::optional<LitOutput> inherit_output(const KmsOptions& options,
                                                      std::optional<DrmDevice>& card);

}  // namespace lenticule::display
