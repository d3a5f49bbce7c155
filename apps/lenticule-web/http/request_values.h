// SPDX-License-Identifier: Apache-2.0
// Reads values from the JSON body and the query of a request. Other values than expected are an
// HttpError 400.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "apps/lenticule-web/http/message.h"

namespace lenticule::web {

/// Returns the body; an empty object for a request without a body.
[[nodiscard]] nlohmann::ordered_json json_body(const Request& request);
/// Returns the number; none if the object does not contain it.
[[nodiscard]] std::optional<double> body_number(const nlohmann::ordered_json& body,
                                                const char* key);
[[nodiscard]] std::string body_text(const nlohmann::ordered_json& body, const char* key);
/// Returns the number of the query; if it is missing, `otherwise`, if there is one.
[[nodiscard]] double query_number(const Request& request, const char* key,
                                  std::optional<double> otherwise);

}  // namespace lenticule::web
