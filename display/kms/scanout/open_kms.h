// SPDX-License-Identifier: Apache-2.0
// Opens the requested output: finds the connector, chooses mode and CRTC, then takes over the
// running mode or does a modeset.
#pragma once

#include "display/kms/scanout/kms_display.h"
#include "display/kms/scanout/lit_output.h"

namespace lenticule::display {

/// All services in `options` must be set. Throws as open_kms_display().
[[nodiscard]] LitOutput light_output(const KmsOptions& options);

/// Throws Error(Quality) if the output is known to change subpixels and that is not allowed.
void require_exact(const KmsOptions& options, const KmsOutput& output);

}  // namespace lenticule::display
