// SPDX-License-Identifier: Apache-2.0
// Answers requests about the calibration from photographs.
#pragma once

#include <span>

#include "apps/lenticule-web/api/route.h"

namespace lenticule::web {

[[nodiscard]] std::span<const Route> calibration_routes();

}  // namespace lenticule::web
