// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/triple.h"

#include <fmt/format.h>

#include <array>
#include <charconv>

#include "base/error.h"

namespace lenticule::player {

Vec3 parse_triple(const char* flag, const std::string& text) {
  std::array<double, 3> values{};
  const char* at = text.data();
  const char* const end = at + text.size();
  for (size_t i = 0; i < values.size(); ++i) {
    const auto [rest, error] = std::from_chars(at, end, values[i]);
    const bool ended = i + 1 == values.size() ? rest == end : rest != end && *rest == ',';
    if (error != std::errc{} || !std::isfinite(values[i]) || !ended)
      throw Error(ErrorKind::Usage, fmt::format("{} '{}': not three numbers", flag, text),
                  fmt::format("for example {} 0,1.5,-2", flag));
    at = rest + 1;
  }
  return {values[0], values[1], values[2]};
}

}  // namespace lenticule::player
