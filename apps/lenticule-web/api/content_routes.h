// SPDX-License-Identifier: Apache-2.0
// Answers requests about the list that is played and the files of the media folder.
#pragma once

#include <span>

#include "apps/lenticule-web/api/route.h"

namespace lenticule::web {

[[nodiscard]] std::span<const Route> content_routes();

}  // namespace lenticule::web
