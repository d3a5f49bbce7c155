// SPDX-License-Identifier: Apache-2.0
// Route describes an address of the API or a page: who may use it, what answers, and the words of
// the description that /api/v1/openapi.json sends.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>

#include "apps/lenticule-web/http/message.h"

namespace lenticule::web {

class WebSite;

/// Call is a request at the address of a route.
struct Call {
  WebSite& site;
  const Request& request;
  const std::string& name;  ///< text for "{name}"
};

/// Route is an address; "{name}" stands for one part of a path.
struct Route {
  const char* method;
  const char* path;
  Rights rights;
  uint64_t largest_body;
  Response (*answer)(const Call& call);
  const char* summary;
  /// The answer and the body: a media type, or a form in the notation of api/schemas.json; a body
  /// may have several media types.
  const char* result;
  const char* body = nullptr;
  const char* query = nullptr;  ///< form of the query's arguments
  /// Returns the sink of a body that is not empty; null for bodies that go into Request::body.
  std::unique_ptr<BodySink> (*sink)(const Call& call) = nullptr;
  int second_status = 0;  ///< status of a success that is not 200
};

/// Returns all addresses of the API and of the pages.
[[nodiscard]] std::span<const Route> routes();

struct FoundRoute {
  const Route* route = nullptr;
  std::string name{};         ///< text for "{name}"
  bool other_method = false;  ///< true if the path has only routes of other methods
};

/// Returns the route of a request; HEAD has the route of GET.
[[nodiscard]] FoundRoute find_route(const std::string& method, const std::string& path);

/// Returns the description of all routes in the form of OpenAPI 3.0.
[[nodiscard]] nlohmann::ordered_json api_description();

/// Returns the name of a style, script or picture of the pages; empty for another path.
[[nodiscard]] std::string_view asset_of(std::string_view path);

/// Returns a file of the pages, without content if the sender has it. Throws HttpError 404.
[[nodiscard]] Response page_response(std::string_view name, const Request& request);

}  // namespace lenticule::web
