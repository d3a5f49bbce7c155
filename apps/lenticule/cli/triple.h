// SPDX-License-Identifier: Apache-2.0
// parse_triple parses a flag with three numbers: "x,y,z" or "r,g,b".
#pragma once

#include <string>

#include "optics/vec.h"

namespace lenticule::player {

/// Throws Error(Usage) "FLAG 'text': ..." unless `text` is three finite numbers separated by
/// commas.
[[nodiscard]] Vec3 parse_triple(const char* flag, const std::string& text);

}  // namespace lenticule::player
