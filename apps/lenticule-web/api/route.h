// SPDX-License-Identifier: Apache-2.0
// Route describes an address of the API: who may use it, and what answers.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "apps/lenticule-web/http/message.h"

namespace lenticule::web {

class WebSite;

/// Route is an address of the API; "{name}" stands for one part of a path.
struct Route {
  const char* method;
  const char* path;
  Rights rights;
  uint64_t largest_body;
  Response (*answer)(WebSite& site, const Request& request, const std::string& name);
  /// Returns the sink of a body that is not empty; null for bodies that go into Request::body.
  std::unique_ptr<BodySink> (*sink)(WebSite& site, const Request& request,
                                    const std::string& name) = nullptr;
};

/// Largest body of a request whose values are a few words and numbers.
inline constexpr uint64_t kSmallBody = 4096;

struct FoundRoute {
  const Route* route = nullptr;
  std::string name{};         ///< text for "{name}"
  bool other_method = false;  ///< true if the path has only routes of other methods
};

/// Returns the route of a request; HEAD has the route of GET.
[[nodiscard]] FoundRoute find_route(std::span<const Route> routes, const std::string& method,
                                    const std::string& path);

}  // namespace lenticule::web
