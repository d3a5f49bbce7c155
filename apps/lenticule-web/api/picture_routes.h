// SPDX-License-Identifier: Apache-2.0
// Answers requests for pictures of the displayed frame, and for the optics that they show.
#pragma once

#include <span>
#include <string>

#include "apps/lenticule-web/api/route.h"

namespace lenticule::web {

[[nodiscard]] std::span<const Route> picture_routes();

/// Returns an answer with a JPEG file.
[[nodiscard]] Response jpeg_response(std::string jpeg);

}  // namespace lenticule::web
