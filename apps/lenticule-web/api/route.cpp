// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/route.h"

#include <optional>
#include <string_view>

namespace lenticule::web {
namespace {

/// Returns the text for "{name}" if the path fits the pattern; none if it does not.
std::optional<std::string> fits(std::string_view pattern, std::string_view path) {
  const size_t open = pattern.find("{name}");
  if (open == std::string_view::npos)
    return pattern == path ? std::optional<std::string>("") : std::nullopt;
  const std::string_view before = pattern.substr(0, open);
  const std::string_view after = pattern.substr(open + 6);
  if (path.size() <= before.size() + after.size() || !path.starts_with(before) ||
      !path.ends_with(after))
    return std::nullopt;
  const std::string_view name =
      path.substr(before.size(), path.size() - before.size() - after.size());
  if (name.find('/') != std::string_view::npos) return std::nullopt;
  return std::string(name);
}

}  // namespace

FoundRoute find_route(std::span<const Route> routes, const std::string& method,
                      const std::string& path) {
  FoundRoute found;
  const std::string wanted = method == "HEAD" ? "GET" : method;
  for (const Route& route : routes) {
    const auto name = fits(route.path, path);
    if (!name) continue;
    if (wanted == route.method) return {.route = &route, .name = *name};
    found.other_method = true;
  }
  return found;
}

}  // namespace lenticule::web
