// SPDX-License-Identifier: Apache-2.0
// Answers requests for pages and for the files that pages are made of.
#pragma once

#include <span>
#include <string_view>

#include "apps/lenticule-web/api/route.h"

namespace lenticule::web {

[[nodiscard]] std::span<const Route> page_routes();

/// Returns the name of a style, script or picture of the pages; empty for another path.
[[nodiscard]] std::string_view asset_of(std::string_view path);

/// Returns a file of the pages, without content if the sender has it. Throws HttpError 404.
[[nodiscard]] Response page_response(std::string_view name, const Request& request);

}  // namespace lenticule::web
