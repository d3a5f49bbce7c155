// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/triple.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/numbers.h"

namespace lenticule::player {

Vec3 parse_triple(const char* flag, const std::string& text) {
  const auto values = numbers_from<double, 3>(text, ',');
  if (!values)
    throw Error(ErrorKind::Usage, fmt::format("{} '{}': not three numbers", flag, text),
                fmt::format("for example {} 0,1.5,-2", flag));
  return {(*values)[0], (*values)[1], (*values)[2]};
}

}  // namespace lenticule::player
