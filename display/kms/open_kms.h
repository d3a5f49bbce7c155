// SPDX-License-Identifier: Apache-2.0
// From a wish to a lit panel: find, choose, inherit or light up.
#pragma once

#include "display/kms/kms_display.h"
#include "display/kms/lit_output.h"

namespace lenticule::display {

/// `options` with all services filled in. Throws as open_kms_display().
[[nodiscard]] LitOutput light_output(const KmsOptions& options);

}  // namespace lenticule::display
