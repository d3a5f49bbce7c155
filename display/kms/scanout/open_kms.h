// SPDX-License-Identifier: Apache-2.0
// From a wish to a lit panel: find, choose, inherit or light up.
#pragma once

#include "display/kms/scanout/kms_display.h"
#include "display/kms/scanout/lit_output.h"

namespace lenticule::display {

/// `options` with all services filled in. Throws as open_kms_display().
[[nodiscard]] LitOutput light_output(const KmsOptions& options);

/// Throws Error(Quality) if the output is known to change subpixels and that is not allowed.
void require_exact(const KmsOptions& options, const KmsOutput& output);

}  // namespace lenticule::display
