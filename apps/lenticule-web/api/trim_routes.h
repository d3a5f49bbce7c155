// SPDX-License-Identifier: Apache-2.0
// Answers requests about the trim: the present one, changes, their history.
#pragma once

#include <span>

#include "apps/lenticule-web/api/route.h"

namespace lenticule::web {

[[nodiscard]] std::span<const Route> trim_routes();

}  // namespace lenticule::web
